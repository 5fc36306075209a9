#pragma once
/// One question at a time that is thought about beside the control thread.

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <optional>
#include <utility>

#include "common/runtime/realtime.h"

namespace hamel::planner {

template <class Answer>
class Aside {
 public:
  using Think = std::function<Answer(const std::function<bool()>& stop)>;

  Aside() = default;
  ~Aside() { forget(); }
  Aside(const Aside&) = delete;
  Aside& operator=(const Aside&) = delete;

  /// Forgets the question before and thinks about this one, on a thread of its own.
  /// @param think  ends soon after `stop` says true; its answer is then nobody's
  void ask(Think think) {
    forget();
    stop_ = false;
    answer_ = std::async(std::launch::async, [this, think = std::move(think)] {
      runtime::go_ordinary();  // many cycles' work: beside the loop, not before it
      return think([this] { return stop_.load(); });
    });
  }
  /// Ends a question that nobody waits for any more.
  void forget() {
    stop_ = true;
    answer_ = {};  // waits for the thread
  }
  /// There is a question whose answer nobody has taken.
  bool asked() const noexcept { return answer_.valid(); }
  /// The answer, once; none where nothing was asked or, without `wait`, where it is not there yet.
  std::optional<Answer> take(bool wait) {
    if (!asked() || (!wait && answer_.wait_for(std::chrono::seconds(0)) != std::future_status::ready))
      return {};
    return answer_.get();
  }

 private:
  std::atomic<bool> stop_ = false;  // before answer_: outlives its thread
  std::future<Answer> answer_;
};

}  // namespace hamel::planner
