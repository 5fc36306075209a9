#include "clients/hamel/replay.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "clients/hamel/compare.h"
#include "clients/hamel/tape.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "services/dynamics/service.h"
#include "services/planner/service.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Time = runtime::Clock::time_point;

namespace {

/// The recorded messages of one topic on their way to a service, in order.
class Feed {
 public:
  Feed(bus::Node& node, const Topic& topic, const std::vector<Recorded>& messages)
      : writer_(node.writer(topic)), messages_(messages) {}
  const Recorded* next() const { return at_ < messages_.size() ? &messages_[at_] : nullptr; }
  void send() { writer_->write(messages_[at_++].payload); }
  /// Sends the next ones for as long as `wanted` says so of them.
  template <class Wanted>
  void send_while(Wanted&& wanted) {
    while (next() != nullptr && wanted(*next())) send();
  }
  void send_before(std::uint64_t place) {
    send_while([&](const Recorded& r) { return r.place < place; });
  }

 private:
  std::unique_ptr<bus::Writer> writer_;
  const std::vector<Recorded>& messages_;
  std::size_t at_ = 0;
};

/// What a service says on one topic, against the recording.
class Judge {
 public:
  Judge(bus::Node& node, const Topic& topic, const std::vector<Recorded>& expected, Comparison& comparison)
      : topic_(topic), reader_(node.reader(topic)), expected_(expected), comparison_(comparison) {}

  /// Compares what came; `step_of` tells which step a payload is about.  Steps that were not recorded are
  /// passed over.
  void take() {
    while (reader_->take(payload_)) {
      const std::uint64_t step = step_of(payload_);
      while (at_ < expected_.size() && expected_[at_].step < step)
        comparison_.missing(topic_, expected_[at_++].step);
      if (at_ >= expected_.size() || expected_[at_].step != step) continue;
      comparison_.compare(topic_, step, expected_[at_].payload, payload_);
      ++at_;
    }
  }
  /// Nothing more will come: what was recorded up to `end` must have been given.
  void finish(std::size_t end) {
    take();
    for (; at_ < end; ++at_) comparison_.missing(topic_, expected_[at_].step);
  }
  std::size_t at() const { return at_; }

 private:
  std::uint64_t step_of(const bus::Payload& payload) const {
    const auto fields = wire::fields(topic_, payload);
    if (!fields) return 0;
    for (const auto& f : fields.value())
      if (f.path == "step") return std::get<std::uint64_t>(f.value);
    return 0;
  }

  const Topic& topic_;
  std::unique_ptr<bus::Reader> reader_;
  const std::vector<Recorded>& expected_;
  Comparison& comparison_;
  bus::Payload payload_;
  std::size_t at_ = 0;
};

/// The newest message of a kind of service that this one names as its cause; none: it knew none.
std::optional<std::uint64_t> cause(const Recorded& r, wire::ServiceKind kind) {
  std::optional<std::uint64_t> newest;
  for (std::size_t i = 0; i < r.caused_by.size; ++i)
    if (r.caused_by.items[i].service == kind)
      newest = std::max(newest.value_or(0), r.caused_by.items[i].sequence);
  return newest;
}

/// How many of the messages belong to the first life of their writer; a note where there is another.
std::size_t first_life(const std::vector<Recorded>& messages, const char* who, std::string& note) {
  for (std::size_t i = 1; i < messages.size(); ++i) {
    if (messages[i].incarnation == messages[0].incarnation && messages[i].epoch == messages[0].epoch)
      continue;
    note = fmt::format("{} began anew at step {}: compared up to there", who, messages[i].step);
    return i;
  }
  return messages.size();
}

std::optional<Problem> into_planner(bus::Node& node, const Tape& tape, Comparison& comparison,
                                    std::string& note) {
  Judge commands(node, topics::kCommand, tape.commands, comparison);
  Judge reports(node, topics::kReport, tape.reports, comparison);
  Feed states(node, topics::kState, tape.states), obstacles(node, topics::kObstacles, tape.obstacles),
      goals(node, topics::kGoal, tape.goals), modes(node, topics::kMode, tape.modes);
  auto service = planner::PlannerService::make(node, *tape.scene, {.pace = tape.pace, .patient = true});
  if (!service) return service.error();
  const std::size_t end = first_life(tape.commands, "the planner or the arm", note);
  Time now = runtime::Clock::now();
  for (std::size_t i = 0; i < end; ++i) {
    const Recorded& c = tape.commands[i];
    const auto set = cause(c, wire::ServiceKind::perception), goal = cause(c, wire::ServiceKind::client);
    goals.send_while([&](const Recorded& r) { return goal && r.sequence <= *goal; });
    obstacles.send_while([&](const Recorded& r) { return set && r.sequence <= *set; });
    states.send_while([&](const Recorded& s) {
      const bool wanted = s.incarnation == c.incarnation && s.step <= c.step;
      if (wanted) modes.send_before(s.place);
      return wanted;
    });
    now += 20ms;  // longer than the period of reports: each step gives one
    service.value()->poll(now);
    commands.take();
    reports.take();
  }
  commands.finish(end);
  // in real time the last ones may speak of silence, which a replay does not hear
  if (tape.pace == scene::Pace::lockstep && note.empty()) reports.finish(tape.reports.size());
  return {};
}

/// In lockstep each command moves the arm up to the next step that wants one.
void drive_lockstep(dynamics::DynamicsService& arm, const Tape& tape, Feed& commands, Feed& modes,
                    Judge& states, std::size_t end) {
  const Time now = runtime::Clock::now();
  const auto settle = [&] {
    while (arm.poll(now)) states.take();
    states.take();
  };
  settle();
  while (!arm.finished() && states.at() < end && commands.next() != nullptr && tape.scene->steered) {
    modes.send_before(commands.next()->place);
    commands.send();
    settle();
  }
}

/// In real time each poll makes one step, under the command that its state names as its cause.
void drive_realtime(dynamics::DynamicsService& arm, const Tape& tape, Feed& commands, Feed& modes,
                    Judge& states, std::size_t end) {
  Time now = runtime::Clock::now();
  for (std::size_t i = 1; i < end && !arm.finished(); ++i) {
    const Recorded& s = tape.states[i];
    const auto command = cause(s, wire::ServiceKind::planner);
    commands.send_while([&](const Recorded& c) { return command && c.step <= *command; });
    modes.send_before(s.place);
    arm.poll(now);
    now = arm.due();
    states.take();
  }
}

std::optional<Problem> into_dynamics(bus::Node& node, const Tape& tape, Comparison& comparison,
                                     std::string& note) {
  Judge states(node, topics::kState, tape.states, comparison);
  Feed commands(node, topics::kCommand, tape.commands), modes(node, topics::kMode, tape.modes);
  wire::Subscription<wire::RunSummary> summaries(node);
  auto service = dynamics::DynamicsService::make(
      node, *tape.scene,
      {.pace = tape.pace, .endless = false, .incarnation = tape.states.front().incarnation});
  if (!service) return service.error();
  const std::size_t end = first_life(tape.states, "dynamics", note);
  const auto drive = tape.pace == scene::Pace::lockstep ? drive_lockstep : drive_realtime;
  drive(*service.value(), tape, commands, modes, states, end);
  states.finish(end);
  return {};
}

int tell(const ReplayArgs& args, const Comparison& c, const std::string& note) {
  const bool same = c.different() == 0 && c.compared() > 0;
  if (args.json) {
    nlohmann::ordered_json j{{"file", args.path},        {"into", args.into},          {"same", same},
                             {"compared", c.compared()}, {"different", c.different()}, {"note", note}};
    if (c.first())
      j["first"] = {{"topic", c.first()->topic},
                    {"step", c.first()->step},
                    {"field", c.first()->field},
                    {"recorded", c.first()->recorded},
                    {"replayed", c.first()->replayed}};
    fmt::print("{}\n", j.dump(2));
  } else {
    if (!note.empty()) fmt::print("{}: {}\n", args.path, note);
    fmt::print("{}: {} messages of {} compared, {} differ\n", args.path, c.compared(), args.into,
               c.different());
    if (c.first())
      fmt::print("  first: {} at step {}: {}\n    recorded {}\n    replayed {}\n", c.first()->topic,
                 c.first()->step, c.first()->field, c.first()->recorded, c.first()->replayed);
  }
  return same || !args.check ? runtime::kDone : runtime::kFailed;
}

}  // namespace

int replay(const ReplayArgs& args) {
  runtime::start_log("hamel", false);
  spdlog::set_level(spdlog::level::warn);
  Comparison comparison;
  for (const std::string& t : args.tolerances)
    if (const auto p = comparison.tolerate(t)) return runtime::complain("hamel replay", {*p});
  const auto tape = load_tape({args.path, args.scene_path, args.overrides});
  if (!tape) return runtime::complain("hamel replay", tape.error());
  bus::NodeOptions options;
  options.name = "hamel-replay";
  auto node = bus::open(options);
  if (!node) return runtime::complain("hamel replay", {node.error()});
  std::string note;
  const auto into = args.into == "planner" ? into_planner : into_dynamics;
  if (const auto problem = into(*node.value(), tape.value(), comparison, note))
    return runtime::complain("hamel replay", {*problem});
  if (comparison.compared() == 0 && comparison.different() == 0) {
    fmt::print(stderr, "hamel replay: {}: holds nothing that {} said\n", args.path, args.into);
    return runtime::kNoData;
  }
  return tell(args, comparison, note);
}

}  // namespace hamel::client
