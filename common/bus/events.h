#pragma once
/// What a vendor's threads tell about the ends of a node, and how its owner hears of it.  Private to
/// common/bus.

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>
#include <vector>

#include "common/bus/network.h"
#include "common/bus/notifier.h"

namespace hamel::bus {

/// The notifier of a node, and what its owner has not told or looked at yet.
class Inbound {
 public:
  Notifier notifier;

  /// Others have ends that they had not, or we a topic more.  Wakes nobody: the owner looks when it has
  /// waited.
  void ends_changed() noexcept { changed_ = true; }

  void disagree(const Disagreement& d) {
    {
      const std::lock_guard lock(mutex_);
      if (std::find(untold_.begin(), untold_.end(), d) == untold_.end()) untold_.push_back(d);
    }
    any_ = true;
    notifier.notify();
  }
  void count(std::int32_t change) { incompatible_ += static_cast<std::uint64_t>(std::max(change, 0)); }
  std::uint64_t incompatible() const { return incompatible_; }

  /// Waits as Node::wait() does, then tells what is untold to `tell(Disagreement)`, and has the owner
  /// `look()` where ends have changed, twice a second at most.
  template <class Tell, class Look>
  bool wait(std::chrono::steady_clock::time_point deadline, std::chrono::microseconds awake, Tell tell,
            Look look) {
    const bool woken = notifier.wait(deadline, awake);
    if (changed_ && due()) look();
    if (!any_.exchange(false)) return woken;
    std::vector<Disagreement> untold;
    {
      const std::lock_guard lock(mutex_);
      untold.swap(untold_);
    }
    for (const Disagreement& d : untold) tell(d);
    return woken;
  }

 private:
  bool due() {
    const auto now = std::chrono::steady_clock::now();
    if (now - looked_ < std::chrono::milliseconds(500)) return false;
    looked_ = now;
    changed_ = false;
    return true;
  }

  std::atomic<bool> any_{false}, changed_{false};
  std::chrono::steady_clock::time_point looked_{};
  std::atomic<std::uint64_t> incompatible_{0};
  std::mutex mutex_;
  std::vector<Disagreement> untold_;
};

/// So many samples that are nothing to take, a reader passes over at a time; it wakes its owner for the rest.
inline constexpr int kPassedOver = 64;

/// One end of a topic.  Kept until the participant is gone, so that a callback on its way finds it in place.
struct Events {
  Events(const Topic& t, Inbound& i, bool writes, Ask a) : topic(t), inbound(i), we_write(writes), ask(a) {}

  void incompatible_with(int policy, std::int32_t change) {
    inbound.disagree({&topic, we_write, ask, policy});
    incompatible += static_cast<std::uint64_t>(std::max(change, 0));
    inbound.count(change);
  }
  /// Something came for this reader; called by vendors' threads.
  void arrived() noexcept {
    waits = true;
    inbound.notifier.notify();
  }
  static void add(std::atomic<std::uint64_t>& counter, std::int32_t change) {
    counter += static_cast<std::uint64_t>(std::max(change, 0));
  }
  Counters counters(std::uint64_t samples, std::uint64_t refused, std::uint64_t disposed = 0) const {
    return {samples, lost, refused, incompatible, disposed, late, silent};
  }

  const Topic& topic;
  Inbound& inbound;
  const bool we_write;
  const Ask ask;
  std::atomic<int> matched{0};
  std::atomic<std::uint64_t> incompatible{0}, lost{0}, late{0}, silent{0};
  std::atomic<bool> waits{true};  ///< there may be something to take: asking the vendor is dear
};

}  // namespace hamel::bus
