#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "common/record/reader.h"

namespace hamel::record {

Result<std::unique_ptr<File>, Problem> File::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return Problem{path, std::string("cannot read: ") + std::strerror(errno)};
  struct stat s {};
  const bool regular = ::fstat(fd, &s) == 0 && S_ISREG(s.st_mode);
  std::unique_ptr<File> file(new File(path, fd, regular ? static_cast<std::uint64_t>(s.st_size) : 0));
  if (!regular) return Problem{path, "is no file"};
  return file;
}

File::~File() { ::close(fd_); }

bool File::read(std::uint64_t offset, std::uint64_t n, Bytes& out) const {
  out.clear();
  if (offset > size_ || n > size_ - offset) return false;
  out.resize(static_cast<std::size_t>(n));
  std::size_t at = 0;
  while (at < out.size()) {
    const ssize_t got = ::pread(fd_, out.data() + at, out.size() - at, static_cast<off_t>(offset + at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += static_cast<std::size_t>(got);
  }
  return true;
}

}  // namespace hamel::record
