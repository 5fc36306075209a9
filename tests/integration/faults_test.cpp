/// A bad network between the arm and its planner: loss, delay, duplication, disorder, partition.  Both ends
/// run in this process on buses of their own; a relay with a seed carries the bytes between them, and the
/// test gives the time, so every case is the same every time.

#include <gtest/gtest.h>

#include <deque>
#include <random>

#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/service.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

struct Faults {
  const char* name = "none";
  double loss = 0, duplicate = 0;
  int delay_ms = 0, jitter_ms = 0;             ///< jitter: later ones overtake earlier ones
  double cut_from_s = 1e9, cut_until_s = 1e9;  ///< nothing passes in between
};

/// Carries one topic one way.
class Wire {
 public:
  Wire(bus::Node& from, bus::Node& to, const Topic& topic)
      : in_(from.reader(topic)), out_(to.writer(topic)) {}
  void carry(const Faults& f, double t_s, std::mt19937_64& random) {
    const auto chance = [&](double p) { return std::uniform_real_distribution<>()(random) < p; };
    bus::Payload p;
    while (in_->take(p)) {
      if (chance(f.loss) || (t_s >= f.cut_from_s && t_s < f.cut_until_s)) continue;
      for (int copies = chance(f.duplicate) ? 2 : 1; copies > 0; --copies) {
        const int late =
            f.jitter_ms > 0 ? static_cast<int>(random() % static_cast<unsigned>(f.jitter_ms)) : 0;
        const double due_s = t_s + 1e-3 * (f.delay_ms + late);
        const auto at = std::upper_bound(waiting_.begin(), waiting_.end(), due_s,
                                         [](double due, const auto& w) { return due < w.first; });
        waiting_.insert(at, {due_s, p});
      }
    }
    for (; !waiting_.empty() && waiting_.front().first <= t_s + 1e-9; waiting_.pop_front())
      out_->write(waiting_.front().second);
  }

 private:
  std::unique_ptr<bus::Reader> in_;
  std::unique_ptr<bus::Writer> out_;
  std::deque<std::pair<double, bus::Payload>> waiting_;
};

struct Told {
  wire::RunSummary summary;
  wire::PlannerReport report;
  dynamics::Outcome outcome = dynamics::Outcome::running;
  std::uint64_t held = 0;  ///< steps without a fresh command
  double net_s = 0;        ///< time of the network that passed
};

Told run(const Faults& faults, scene::Pace pace, double duration_s, std::uint32_t domain,
         const char* method = "planner.method=gyro") {
  scene::Scene scene = test::shipped("four_link_avoid", {method, "stop=when_reached"});
  scene.duration_s = duration_s;
  const auto here = node(domain), there = node(domain + 1);
  wire::Subscription<wire::RunSummary> summaries(*here);
  wire::Subscription<wire::PlannerReport> reports(*there);
  std::deque<Wire> wires;
  for (const Topic* t : {&topics::kState, &topics::kClock}) wires.emplace_back(*here, *there, *t);
  wires.emplace_back(*there, *here, topics::kCommand);
  auto arm = made(dynamics::DynamicsService::make(*here, scene, {.pace = pace}));
  auto eyes = std::move(perception::PerceptionService::make(*there, scene)).value();
  auto brain = made(planner::PlannerService::make(*there, scene, {.pace = pace}));
  std::mt19937_64 random(7);
  const auto start = Clock::now();
  auto now = start;
  Told told;
  for (int ms = 0; !arm->finished() && ms < 120000; ++ms) {
    now = start + std::chrono::milliseconds(ms);
    for (bool any = true; any;) {
      any = pace == scene::Pace::lockstep && arm->poll(now);
      for (Wire& w : wires) w.carry(faults, 1e-3 * ms, random);
      any |= eyes->poll(now);
      any |= brain->poll(now);
      if (pace == scene::Pace::realtime) break;
    }
    if (pace == scene::Pace::realtime) arm->poll(now);
    wire::PlannerReport r;
    while (reports.take(r)) {
      told.report = r;
    }
    told.net_s = 1e-3 * ms;
  }
  told.outcome = arm->outcome();
  arm->close();
  wire::RunSummary last;
  while (summaries.take(last)) told.summary = last;
  told.held = told.summary.commands_missed;
  return told;
}

TEST(Faults, InRealTimeTheArmReachesOrHoldsAndTouchesNothing) {
  std::printf(
      "| network | outcome | contacts | clearance m | steps without a fresh command | s "
      "|\n|---|---|---:|---:|---:|---:|\n");
  struct Case {
    Faults faults;
    bool reaches;
  };
  const Case cases[] = {
      {{"good"}, true},
      {{.name = "loss 10 %", .loss = 0.1}, true},
      {{.name = "loss 30 %", .loss = 0.3}, true},
      {{.name = "delay 20 ms", .delay_ms = 10}, true},
      {{.name = "delay 200 ms", .delay_ms = 100}, false},
      {{.name = "every second doubled", .duplicate = 0.5}, true},
      {{.name = "disorder within 20 ms", .jitter_ms = 20}, true},
      {{.name = "cut for 5 s", .cut_from_s = 2, .cut_until_s = 7}, true},
      {{.name = "all of it", .loss = 0.2, .duplicate = 0.2, .delay_ms = 2, .jitter_ms = 10}, true}};
  std::uint32_t domain = 60;
  for (const auto& [faults, reaches] : cases) {
    const Told t = run(faults, scene::Pace::realtime, 25, domain += 2);
    std::printf("| %s | %s | %u | %.4f | %llu | %.1f |\n", faults.name, wire::to_string(t.report.state),
                t.report.contacts, t.report.clearance_min_m, static_cast<unsigned long long>(t.held),
                t.net_s);
    EXPECT_EQ(t.report.contacts, 0u) << faults.name;
    EXPECT_GT(t.report.clearance_min_m, 0) << faults.name;
    EXPECT_EQ(t.report.state == wire::PlannerState::reached, reaches)
        << faults.name << ": " << t.report.detail;
  }
}

// The paper's method remembers how it began: a start that differs (a ramp) ends on another way.
TEST(Faults, OnAGoodNetworkRealTimeTakesTheWayOfLockstep) {
  const char* method = "planner.method=gyro_paper";
  const Told lockstep = run({}, scene::Pace::lockstep, 9, 110, method);
  const Told realtime = run({}, scene::Pace::realtime, 9, 112, method);
  EXPECT_EQ(realtime.report.state, wire::PlannerState::reached);
  EXPECT_NEAR(realtime.report.time_to_goal_s, lockstep.report.time_to_goal_s, 0.1);
  EXPECT_NEAR(realtime.report.clearance_min_m, lockstep.report.clearance_min_m, 1e-3);
}

TEST(Faults, InLockstepABadNetworkChangesTheTimeNotTheTrajectory) {
  const Told good = run({}, scene::Pace::lockstep, 2, 80);
  EXPECT_EQ(good.outcome, dynamics::Outcome::done);
  std::uint32_t domain = 82;
  for (const Faults& f : {Faults{.name = "loss", .loss = 0.02}, Faults{.name = "doubled", .duplicate = 0.5},
                          Faults{.name = "disorder", .jitter_ms = 5},
                          Faults{.name = "cut for 5 s", .cut_from_s = 1, .cut_until_s = 6}}) {
    const Told bad = run(f, scene::Pace::lockstep, 2, domain += 2);
    EXPECT_EQ(bad.outcome, dynamics::Outcome::done) << f.name;
    EXPECT_EQ(bad.summary.trajectory_hash, good.summary.trajectory_hash) << f.name;
  }
}

TEST(Faults, InLockstepACutWithoutEndIsTheEndWithAName) {
  const Told t = run({.name = "cut", .cut_from_s = 0.05}, scene::Pace::lockstep, 2, 98);
  EXPECT_EQ(t.outcome, dynamics::Outcome::no_command);
  EXPECT_EQ(t.summary.outcome, "no_command");
  EXPECT_LT(t.net_s, 11) << "patience is ten seconds";
}

/// A stranger floods the command topic with valid and broken messages: refused and counted, nothing grows.
TEST(Flood, OfCommandsIsRefusedAndTheArmGoesOn) {
  const auto n = node(58);
  const scene::Scene scene = test::shipped("four_link_avoid");
  auto arm =
      made(dynamics::DynamicsService::make(*n, scene, {.pace = scene::Pace::realtime, .incarnation = 3}));
  const auto stranger = n->writer(topics::kCommand);
  wire::Subscription<wire::ServiceStatus> statuses(*n);
  wire::TorqueCommand c;
  c.arm = 1;
  c.epoch = ~0ull;
  c.state_incarnation = 99;
  c.torque = wire::JointVector::Constant(4, 1e6);
  bus::Payload valid, broken;
  ASSERT_TRUE(wire::encode(c, valid));
  broken = valid;
  broken.resize(20);
  auto now = Clock::now();
  for (int ms = 0; ms < 1000; ++ms) {
    for (int i = 0; i < 100; ++i) stranger->write(i % 2 == 0 ? valid : broken);
    arm->poll(now += 1ms);
  }
  EXPECT_EQ(arm->arm().state().step, 1000u) << "no step is lost";
  EXPECT_LT(arm->arm().state().qd.lpNorm<Eigen::Infinity>(), 1e-9) << "and nothing moves";
  wire::ServiceStatus status, last;
  while (statuses.take(status)) last = status;
  std::uint64_t refused = 0, undecodable = 0;
  for (const auto& counter : last.counters) {
    if (counter.name == "commands_refused") refused = counter.value;
    if (counter.name == "undecodable") undecodable = counter.value;
  }
  EXPECT_GT(refused, 1000u);
  EXPECT_GT(undecodable, 1000u);
}

}  // namespace
