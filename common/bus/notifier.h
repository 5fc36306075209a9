#pragma once
/// One bit: how any thread wakes the owner of a node.  Private to common/bus.

#include <linux/futex.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <utility>

namespace hamel::bus {

/// A notify() that finds its owner awake costs no system call.
class Notifier {
 public:
  using Clock = std::chrono::steady_clock;

  void notify() noexcept {
    if (bit_.exchange(kSet, std::memory_order_acq_rel) != kAsleep) return;
    syscall(SYS_futex, &bit_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
  }

  /// True when notified since the last wait() that returned true.  Stays `awake` for a while before it
  /// sleeps, where nobody else wants the processor.
  bool wait(Clock::time_point deadline, Clock::duration awake = {}) noexcept {
    if (take() || (awake > awake.zero() && look_around(deadline, awake))) return true;
    // FUTEX_WAIT_BITSET: its time is absolute, on CLOCK_MONOTONIC, which is what steady_clock shows.
    const auto ns = std::max<std::int64_t>(std::chrono::nanoseconds(deadline.time_since_epoch()).count(), 0);
    const timespec until{static_cast<time_t>(ns / 1000000000), static_cast<long>(ns % 1000000000)};
    std::uint32_t idle = kIdle;
    bit_.compare_exchange_strong(idle, kAsleep, std::memory_order_acq_rel);
    while (bit_.load(std::memory_order_acquire) == kAsleep && Clock::now() < deadline)
      syscall(SYS_futex, &bit_, FUTEX_WAIT_BITSET_PRIVATE, kAsleep, &until, nullptr, FUTEX_BITSET_MATCH_ANY);
    return bit_.exchange(kIdle, std::memory_order_acq_rel) == kSet;
  }

 private:
  enum : std::uint32_t { kIdle, kSet, kAsleep };
  bool take() noexcept {
    std::uint32_t set = kSet;
    return bit_.compare_exchange_strong(set, kIdle, std::memory_order_acq_rel);
  }
  bool look_around(Clock::time_point deadline, Clock::duration awake) noexcept {
    if (asleep_for_ > 0) {
      --asleep_for_;
      return false;
    }
    auto now = Clock::now();
    for (const auto until = std::min(deadline, now + awake); now < until;) {
      if (take()) return true;
      sched_yield();
      const auto before = std::exchange(now, Clock::now());
      if (now - before < kSlice) continue;
      // Another program had its slice: who sleeps is woken sooner than who waits for a turn.
      asleep_for_ = penalty_ = std::min(2 * penalty_ + 16, 4096);
      return take();
    }
    penalty_ -= penalty_ / 4;
    return false;
  }

  static constexpr std::chrono::microseconds kSlice{300};
  std::atomic<std::uint32_t> bit_{kIdle};
  int asleep_for_ = 0, penalty_ = 0;  ///< waits without looking around; the owner's
};

}  // namespace hamel::bus
