#pragma once
/// A file that survives a power cut, written by a thread of its own.

#include <atomic>
#include <cstddef>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace hamel::runtime {

/// Each copy is written beside `path`, flushed, and renamed to it: the file is whole at any moment.  What the
/// disk refuses is logged, once until it takes one again.
class DiskCopy {
 public:
  /// `capacity`: bytes of the longest copy.
  DiskCopy(std::string path, std::size_t capacity);
  /// Waits for the copy on its way.
  ~DiskCopy();
  DiskCopy(const DiskCopy&) = delete;
  DiskCopy& operator=(const DiskCopy&) = delete;

  /// Hands these bytes to the thread.  False while the copy before is on its way.  Waits for nothing.
  bool write(std::span<const std::byte> bytes) noexcept;

 private:
  enum class Job : int { none, copy, end };
  void work();
  std::string store() const;

  const std::string path_;
  std::vector<std::byte> bytes_;  ///< the thread's while its job is to copy, ours otherwise
  std::atomic<Job> job_ = Job::none;
  std::thread thread_;
};

}  // namespace hamel::runtime
