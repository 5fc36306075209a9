#include "common/runtime/disk_copy.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "common/runtime/log.h"
#include "common/runtime/realtime.h"

namespace hamel::runtime {

namespace {

bool write_all(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

/// A new name is on the disk once its folder is.
bool flush_folder(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  const int fd = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool flushed = fd >= 0 && fsync(fd) == 0;
  if (fd >= 0) ::close(fd);
  return flushed;
}

}  // namespace

DiskCopy::DiskCopy(std::string path, std::size_t capacity) : path_(std::move(path)) {
  bytes_.reserve(capacity);
  thread_ = std::thread([this] { work(); });
}

DiskCopy::~DiskCopy() {
  job_.wait(Job::copy);
  job_ = Job::end;
  job_.notify_all();
  thread_.join();
}

bool DiskCopy::write(std::span<const std::byte> bytes) noexcept {
  if (job_ != Job::none || bytes.size() > bytes_.capacity()) return false;
  bytes_.assign(bytes.begin(), bytes.end());
  job_ = Job::copy;
  job_.notify_all();
  return true;
}

void DiskCopy::work() {
  go_ordinary();
  for (bool failing = false;;) {
    job_.wait(Job::none);
    if (job_ == Job::end) return;
    const std::string problem = store();
    if (!problem.empty() && !failing)
      spdlog::warn("{}: no copy that survives a power cut: {}", path_, problem);
    failing = !problem.empty();
    job_ = Job::none;
    job_.notify_all();
  }
}

/// @return what the disk refused; empty: stored
std::string DiskCopy::store() const {
  const std::string fresh = path_ + ".new";
  const int fd = ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return std::strerror(errno);
  const bool flushed = write_all(fd, bytes_) && fdatasync(fd) == 0;
  const int why = errno;
  ::close(fd);
  if (!flushed) return std::strerror(why);
  if (std::rename(fresh.c_str(), path_.c_str()) != 0 || !flush_folder(path_)) return std::strerror(errno);
  return {};
}

}  // namespace hamel::runtime
