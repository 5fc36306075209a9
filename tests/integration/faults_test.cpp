/// A bad network between the arm and its planner: loss, delay, duplication, disorder, partition.  Both ends
/// run in this process on buses of their own; a relay with a seed carries the bytes between them, and the
/// test gives the time, so every case is the same every time.

#include <gtest/gtest.h>

#include <deque>
#include <random>
#include <span>

#include "clients/hamel/judge.h"
#include "services/dynamics/service.h"
#include "services/perception/core/source.h"
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
  int caused = 0, others = 0;  ///< contacts of the arm's making and not, as the judge sees it
  double clearance_m = 0;      ///< the least, as the judge sees it
  double net_s = 0;            ///< time of the network that passed
};

/// Who sees arm and obstacles where they are, not where messages say they were.
class Witness {
 public:
  explicit Witness(const scene::Scene& s)
      : judge_(s.robot), source_(std::move(perception::Source::make(s.perception)).value()) {}
  void look(const dynamics::Arm& arm, Told& told) {
    const bool known = source_.at(arm.t_s(), obstacles_);
    const client::Contact* c = known ? judge_.advance(arm.t_s(), arm.state().q, obstacles_) : nullptr;
    const bool touches = c != nullptr;
    if (touches && !touched_) ++(c->arm_caused ? told.caused : told.others);
    touched_ = touches;
    told.clearance_m = judge_.clearance_min_m();
  }

 private:
  client::Judge judge_;
  const perception::Source source_;
  std::vector<geometry::Obstacle> obstacles_;
  bool touched_ = false;
};

/// Arm, planner and perception on three hosts; everything that passes between them is relayed.
Told run(const Faults& faults, scene::Pace pace, double duration_s, std::uint32_t domain,
         const char* method = "planner.method=gyro", const char* name = "four_link_avoid") {
  scene::Scene scene = test::shipped(name, {method, "stop=when_reached"});
  scene.duration_s = duration_s;
  const auto body = node(domain), head = node(domain + 1), camera = node(domain + 2);
  wire::Subscription<wire::RunSummary> summaries(*body);
  wire::Subscription<wire::PlannerReport> reports(*head);
  std::deque<Wire> wires;
  wires.emplace_back(*body, *head, topics::kState);
  wires.emplace_back(*body, *camera, topics::kClock);
  wires.emplace_back(*camera, *head, topics::kObstacles);
  wires.emplace_back(*head, *body, topics::kCommand);
  auto arm = made(dynamics::DynamicsService::make(*body, scene, {.pace = pace}));
  auto eyes = std::move(perception::PerceptionService::make(*camera, scene)).value();
  auto brain = made(planner::PlannerService::make(*head, scene, {.pace = pace}));
  Witness witness(scene);
  std::mt19937_64 random(7);
  const auto start = Clock::now();
  auto now = start;
  Told told;
  for (int ms = 0; !arm->finished() && ms < 600000; ++ms) {
    now = start + std::chrono::milliseconds(ms);
    for (bool any = true; any;) {
      any = pace == scene::Pace::lockstep && arm->poll(now);
      for (Wire& w : wires) w.carry(faults, 1e-3 * ms, random);
      any |= eyes->poll(now);
      any |= brain->poll(now);
      if (pace == scene::Pace::realtime) break;
    }
    if (pace == scene::Pace::realtime) arm->poll(now);
    if (pace == scene::Pace::realtime && ms % 5 == 0) witness.look(arm->arm(), told);
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
  return told;
}

struct Case {
  Faults faults;
  bool reaches;
};

/// Runs the cases in real time, and prints a row of each.  No contact is of the arm's making, whatever the
/// network does.
void table(const char* scene, std::span<const Case> cases, double duration_s, std::uint32_t domain) {
  std::printf(
      "| %s | outcome | arm-caused, other contacts | clearance m | steps without a fresh command | s |\n"
      "|---|---|---:|---:|---:|---:|\n",
      scene);
  for (const auto& [faults, reaches] : cases) {
    const Told t = run(faults, scene::Pace::realtime, duration_s, domain += 3, "planner.method=gyro", scene);
    std::printf("| %s | %s | %d, %d | %.4f | %llu | %.1f |\n", faults.name, wire::to_string(t.report.state),
                t.caused, t.others, t.clearance_m, static_cast<unsigned long long>(t.summary.commands_missed),
                t.net_s);
    EXPECT_EQ(t.caused, 0) << faults.name;
    EXPECT_EQ(t.report.state == wire::PlannerState::reached, reaches)
        << faults.name << ": " << t.report.detail;
  }
}

const Faults kLoss10{.name = "loss 10 %", .loss = 0.1}, kLoss30{.name = "loss 30 %", .loss = 0.3},
    kDelay20{.name = "delay 20 ms", .delay_ms = 10}, kDelay200{.name = "delay 200 ms", .delay_ms = 100},
    kCut{.name = "cut for 5 s", .cut_from_s = 2, .cut_until_s = 7},
    kAll{.name = "all of it", .loss = 0.2, .duplicate = 0.2, .delay_ms = 2, .jitter_ms = 10};

TEST(Faults, InRealTimeTheArmReachesOrHoldsAndTouchesNothing) {
  const Case cases[] = {{{"good"}, true},
                        {kLoss10, true},
                        {kLoss30, true},
                        {kDelay20, true},
                        {kDelay200, false},
                        {{.name = "every second doubled", .duplicate = 0.5}, true},
                        {{.name = "disorder within 20 ms", .jitter_ms = 20}, true},
                        {kCut, true},
                        {kAll, true}};
  table("four_link_avoid", cases, 25, 60);
}

TEST(Faults, AmongMovingObstaclesTheArmReachesOrHoldsAndRunsIntoNothing) {
  const Case cases[] = {{{"good"}, true},   {kLoss30, true}, {kDelay20, true},
                        {kDelay200, false}, {kCut, true},    {kAll, true}};
  table("panda_person", cases, 20, 120);
}

// The paper's method remembers how it began: a start that differs (a ramp) ends on another way.
TEST(Faults, OnAGoodNetworkRealTimeTakesTheWayOfLockstep) {
  const char* method = "planner.method=gyro_paper";
  const Told lockstep = run({}, scene::Pace::lockstep, 9, 50, method);
  const Told realtime = run({}, scene::Pace::realtime, 9, 53, method);
  EXPECT_EQ(realtime.report.state, wire::PlannerState::reached);
  EXPECT_NEAR(realtime.report.time_to_goal_s, lockstep.report.time_to_goal_s, 0.1);
  EXPECT_NEAR(realtime.report.clearance_min_m, lockstep.report.clearance_min_m, 1e-3);
}

TEST(Faults, InLockstepABadNetworkChangesTheTimeNotTheTrajectory) {
  std::uint32_t domain = 160;
  for (const char* scene : {"four_link_avoid", "panda_person"}) {
    const auto lockstep = [&](const Faults& f, double duration_s) {
      return run(f, scene::Pace::lockstep, duration_s, domain += 3, "planner.method=gyro", scene);
    };
    const Told good = lockstep({}, 1), brief = lockstep({}, 0.1);
    EXPECT_EQ(good.outcome, dynamics::Outcome::done);
    const Faults cases[] = {{.name = "loss", .loss = 0.02},
                            {.name = "doubled", .duplicate = 0.5},
                            {.name = "disorder", .jitter_ms = 5},
                            {.name = "cut for 5 s", .cut_from_s = 0.5, .cut_until_s = 5.5}};
    for (const Faults& f : cases)
      EXPECT_EQ(lockstep(f, 1).summary.trajectory_hash, good.summary.trajectory_hash)
          << scene << ", " << f.name;
    for (const Faults& f : {kLoss30, kDelay200, kAll}) {  // 0.1 to 0.4 s a step
      const Told bad = lockstep(f, 0.1);
      EXPECT_EQ(bad.outcome, dynamics::Outcome::done) << scene << ", " << f.name;
      EXPECT_EQ(bad.summary.trajectory_hash, brief.summary.trajectory_hash) << scene << ", " << f.name;
    }
  }
}

TEST(Faults, InLockstepACutWithoutEndIsTheEndWithAName) {
  const Told t = run({.name = "cut", .cut_from_s = 0.05}, scene::Pace::lockstep, 2, 56);
  EXPECT_EQ(t.outcome, dynamics::Outcome::no_command);
  EXPECT_EQ(t.summary.outcome, "no_command");
  EXPECT_LT(t.net_s, 11) << "patience is ten seconds";
}

/// A stranger floods the command topic with valid and broken messages: refused and counted, nothing grows.
TEST(Flood, OfCommandsIsRefusedAndTheArmGoesOn) {
  const auto n = node(59);
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
