#pragma once
/// One end of a conversation over a vendor's bare API, with the types that its own generator made of the IDL:
/// states of seven joints one way, commands the other.  QoS and transport as the bus has them.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>

namespace hamel::bench {

inline constexpr int kJoints = 7;

/// How the bare owner sleeps: as the bus's does, on a condition variable that the listener signals.
class Bell {
 public:
  void ring() {
    {
      const std::lock_guard lock(mutex_);
      rung_ = true;
    }
    condition_.notify_one();
  }
  void wait(std::chrono::steady_clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    condition_.wait_until(lock, deadline, [this] { return rung_; });
    rung_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable condition_;
  bool rung_ = false;
};

struct BareEnd {
  virtual ~BareEnd() = default;
  virtual bool matched() = 0;
  virtual void write(std::uint64_t number) = 0;
  /// The number of the next message that waits; 0: none.
  virtual std::uint64_t take() = 0;
  Bell bell;
};

/// `asks`: writes states and reads commands; else the other way round.
std::unique_ptr<BareEnd> bare_fast(bool asks, std::uint32_t domain);
std::unique_ptr<BareEnd> bare_cyclone(bool asks, std::uint32_t domain);

}  // namespace hamel::bench
