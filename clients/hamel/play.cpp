#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "clients/hamel/play_source.h"
#include "clients/hamel/record.h"
#include "common/runtime/log.h"
#include "common/runtime/loop.h"
#include "common/runtime/player_control.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Clock = runtime::Clock;

namespace {

constexpr auto kGlance = 20ms;  // between two looks for commands

/// How late messages went out.
class Lateness {
 public:
  void add(double late_s) {
    ++count_;
    sum_s_ += late_s;
    worst_s_ = std::max(worst_s_, late_s);
    if (late_s_.size() < kKept) late_s_.push_back(static_cast<float>(late_s));
  }
  /// ", late by ..."; empty: nothing had a time.
  std::string report() {
    if (count_ == 0) return "";
    const auto p99 = late_s_.begin() + static_cast<std::ptrdiff_t>(late_s_.size() * 99 / 100);
    std::nth_element(late_s_.begin(), p99, late_s_.end());
    return fmt::format(", late by {:.0f} us on average, p99 {:.0f} us, {:.0f} us at most",
                       sum_s_ / static_cast<double>(count_) * 1e6, static_cast<double>(*p99) * 1e6,
                       worst_s_ * 1e6);
  }

 private:
  static constexpr std::size_t kKept = 1 << 20;  // of a longer play the first ones stand for all
  std::uint64_t count_ = 0;
  double sum_s_ = 0, worst_s_ = 0;
  std::vector<float> late_s_;
};

class Player {
 public:
  Player(bus::Node& node, PlaySource& in, const PlayArgs& args, runtime::StopSignal& stop)
      : node_(node), in_(in), args_(args), stop_(stop), control_(args.control), paused_(args.paused) {
    for (const Topic* topic : in.topics()) writers_[topic] = node.writer(*topic);
  }

  /// Waits until every topic has a reader, or for five seconds.
  void await_readers() {
    const auto deadline = Clock::now() + 5s;
    const auto alone = [](const auto& w) { return w.second->matched() == 0; };
    while (std::any_of(writers_.begin(), writers_.end(), alone) && Clock::now() < deadline && !ended())
      node_.wait(Clock::now() + 10ms);
    if (node_.options().vendor == bus::Vendor::inproc) return;
    for (const auto settled = Clock::now() + 200ms; !ended() && Clock::now() < settled;) node_.wait(settled);
  }

  /// False when it was stopped before the end.
  bool play_once() {
    in_.rewind();
    std::optional<std::uint64_t> first;
    while (const auto message = in_.next()) {
      if (!first) {
        first = args_.begin_s > 0 ? ns(args_.begin_s) : message->time;
        origin_ = Clock::now();
      }
      time_s_ = static_cast<double>(message->time) * 1e-9;
      const double after_s = static_cast<double>(message->time - *first) * 1e-9 / args_.rate;
      const bool on_time = wait_until(runtime::seconds(after_s));
      if (ended()) return false;
      writers_[message->topic]->write(message->payload);
      if (on_time) lateness_.add(std::chrono::duration<double>(Clock::now() - due_).count());
      ++sent_;
    }
    return true;
  }

  std::uint64_t sent() const { return sent_; }
  bool quit() const { return quit_; }
  std::string report() { return fmt::format("{} messages{}", sent_, lateness_.report()); }

 private:
  bool ended() const { return quit_ || stop_.requested(); }

  /// Waits until so long behind the origin, which a pause moves; true then, false when it is to go out as a
  /// single step, or at the end.
  bool wait_until(Clock::duration after) {
    while (!ended()) {
      const auto now = Clock::now();
      if (const auto command = control_.next()) {
        obey(*command, now, after);
        continue;
      }
      if (paused_ && steps_ > 0) {
        --steps_;
        stood_since_ = origin_ + after;  // the clock of the recording stands at this message
        fmt::print(stderr, "step to {:.6f} s\n", time_s_);
        return false;
      }
      due_ = origin_ + after;
      if (!paused_ && now >= due_) return true;
      const auto glance = args_.control ? now + kGlance : now + 200ms;
      node_.wait(paused_ ? glance : std::min(due_, glance));
    }
    return false;
  }

  void obey(runtime::PlayerCommand command, Clock::time_point now, Clock::duration after) {
    using C = runtime::PlayerCommand;
    if (command == C::quit) quit_ = true;
    if (command == C::step) ++steps_;
    const bool pause = command == C::pause || command == C::step || (command == C::toggle && !paused_);
    const bool resume = command == C::resume || (command == C::toggle && paused_);
    if (pause && !paused_) {
      paused_ = true;
      stood_since_ = std::min(now, origin_ + after);
      fmt::print(stderr, "paused before {:.6f} s\n", time_s_);
    } else if (resume && paused_) {
      paused_ = false;
      steps_ = 0;
      origin_ += now - stood_since_.value_or(std::min(now, origin_ + after));
      stood_since_.reset();
      fmt::print(stderr, "goes on\n");
    }
  }

  bus::Node& node_;
  PlaySource& in_;
  const PlayArgs& args_;
  runtime::StopSignal& stop_;
  runtime::PlayerControl control_;
  std::map<const Topic*, std::unique_ptr<bus::Writer>> writers_;
  Lateness lateness_;
  Clock::time_point origin_{}, due_{};  ///< when the first message was due; the present one
  std::optional<Clock::time_point> stood_since_;
  double time_s_ = 0;
  bool paused_ = false, quit_ = false;
  std::uint64_t steps_ = 0, sent_ = 0;
};

}  // namespace

int play(const PlayArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  if (args.paused && !args.control)
    return runtime::complain("hamel play", {{"--paused", "needs --control: nothing could make it go on"}});
  const auto source = open_play_source(args);
  if (!source) return runtime::complain("hamel play", source.error());
  auto node = runtime::open_node(args.bus, "", "hamel-play");
  if (!node) return runtime::complain("hamel play", {node.error()});
  bus::Node& n = *node.value();
  stop.on_stop([&n] { n.wake(); });
  Player player(n, *source.value(), args, stop);
  player.await_readers();
  bool whole = false;
  do {
    const std::uint64_t before = player.sent();
    whole = player.play_once();
    if (player.sent() == before) break;  // nothing there: no use in beginning anew
  } while (args.loop && whole);
  stop.on_stop({});
  runtime::linger(n);
  if (player.sent() == 0 && whole) {
    fmt::print(stderr, "hamel play: {}: holds no such message\n", args.path);
    return runtime::kNoData;
  }
  fmt::print(stderr, "{}: {}\n", args.path, player.report());
  return whole || args.loop || player.quit() ? runtime::kDone : runtime::kInterrupted;
}

}  // namespace hamel::client
