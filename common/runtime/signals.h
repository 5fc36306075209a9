#pragma once
/// Ctrl-C and SIGTERM become a flag that the owner's loop reads.

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>

namespace hamel::runtime {

/// Blocks SIGINT and SIGTERM in the calling thread (and so in all it starts later) and waits for them on a
/// thread of its own.  Make it first in main, before any middleware starts threads.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;
  /// Called once, on the signal thread, when a signal comes; set before the loop starts.
  void on_stop(std::function<void()> wake);
  bool requested() const noexcept { return signal_.load(std::memory_order_relaxed) != 0; }
  int signal() const noexcept { return signal_.load(std::memory_order_relaxed); }

 private:
  std::atomic<int> signal_{0};
  std::atomic<bool> ending_{false};
  std::mutex mutex_;
  std::function<void()> wake_;
  std::thread thread_;
};

}  // namespace hamel::runtime
