#pragma once
/// One bit with a condition variable: how any thread wakes the owner of a node.  Private to common/bus.

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace hamel::bus {

class Notifier {
 public:
  void notify() noexcept {
    {
      std::lock_guard lock(mutex_);
      set_ = true;
    }
    condition_.notify_one();
  }

  /// True when notified since the last wait() that returned true.
  bool wait(std::chrono::steady_clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    const bool woken = condition_.wait_until(lock, deadline, [this] { return set_; });
    set_ = false;
    return woken;
  }

 private:
  std::mutex mutex_;
  std::condition_variable condition_;
  bool set_ = false;
};

}  // namespace hamel::bus
