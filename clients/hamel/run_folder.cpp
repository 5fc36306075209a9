#include "clients/hamel/run_folder.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>

namespace hamel::client {

namespace {

constexpr const char* kOwner = "owner";

/// A descriptor of the locked file; -1: it is not there, not ours, or another holds it.
int lock(const std::string& path, int flags) {
  const int fd = open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
  if (fd < 0 || flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  close(fd);
  return -1;
}

}  // namespace

std::vector<std::string> abandoned_folders() {
  std::vector<std::string> found;
  std::error_code ignored;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::temp_directory_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() != 12 || !name.starts_with("hamel-")) continue;
    const int fd = lock((entry.path() / kOwner).string(), 0);
    if (fd < 0) continue;
    found.push_back(entry.path().string());
    close(fd);
  }
  return found;
}

Result<std::unique_ptr<RunFolder>, Problem> RunFolder::make() {
  std::error_code ignored;
  for (const std::string& old : abandoned_folders()) std::filesystem::remove_all(old, ignored);
  std::string path = (std::filesystem::temp_directory_path() / "hamel-XXXXXX").string();
  if (!mkdtemp(path.data())) return Problem{path, "cannot make a folder for the checkpoints"};
  // Locked before it has its name: nobody finds it free.
  const std::string owner = path + "/" + kOwner, unnamed = owner + ".new";
  const int fd = lock(unnamed, O_CREAT);
  if (fd < 0 || rename(unnamed.c_str(), owner.c_str()) != 0) {
    if (fd >= 0) close(fd);
    return Problem{path, "cannot lock the folder for the checkpoints"};
  }
  return std::unique_ptr<RunFolder>(new RunFolder(path, fd));
}

RunFolder::~RunFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
  close(lock_);
}

}  // namespace hamel::client
