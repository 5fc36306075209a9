/// The services over the in-process bus, with a planner of the test's own.

#include <gtest/gtest.h>

#include <cstring>

#include "common/runtime/options.h"
#include "services/dynamics/service.h"
#include "services/planner/obstacle_view.h"
#include "services/planner/service.h"
#include "tests/support/said.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

/// A planner in lockstep that turns the first joint; one bit of one command may be flipped on its way.
class RelayedPlanner {
 public:
  RelayedPlanner(bus::Node& n, std::uint64_t flip_at) : states_(n), commands_(n), flip_at_(flip_at) {}
  bool poll() {
    wire::ArmState s;
    bool any = false;
    while (states_.take(s)) {
      wire::TorqueCommand c = test::answer_to(s, 0.25);
      if (s.step == flip_at_) {
        std::uint64_t bits;
        std::memcpy(&bits, c.torque.data(), sizeof bits);
        bits ^= std::uint64_t{1} << 40;  // the lowest ones vanish in the rounding of the step
        std::memcpy(c.torque.data(), &bits, sizeof bits);
      }
      commands_.publish(c);
      any = true;
    }
    return any;
  }

 private:
  wire::Subscription<wire::ArmState> states_;
  wire::Publisher<wire::TorqueCommand> commands_;
  const std::uint64_t flip_at_;
};

wire::RunSummary run_relayed(std::uint64_t flip_at) {
  const auto n = node(1);
  const scene::Scene s = test::four_link({"duration_s=0.2"});
  wire::Subscription<wire::RunSummary> summaries(*n);
  RelayedPlanner planner(*n, flip_at);
  auto arm = dynamics::DynamicsService::make(*n, s, {});
  EXPECT_TRUE(arm);
  const auto deadline = Clock::now() + 60s;
  while (!arm.value()->finished() && Clock::now() < deadline) {
    arm.value()->poll(Clock::now());
    planner.poll();
  }
  EXPECT_EQ(arm.value()->outcome(), dynamics::Outcome::done);
  arm.value()->close();
  wire::RunSummary last;
  while (summaries.take(last)) {
  }
  EXPECT_TRUE(last.final_summary);
  return last;
}

TEST(Lockstep, OneFlippedBitOfOneCommandChangesTheTrajectoryHash) {
  constexpr std::uint64_t kNever = ~0ull;
  const auto a = run_relayed(kNever), b = run_relayed(kNever), c = run_relayed(100);
  EXPECT_EQ(a.steps, 200u);
  EXPECT_EQ(a.trajectory_hash, b.trajectory_hash);
  EXPECT_EQ(a.trajectory_hash.size(), 64u);
  EXPECT_NE(a.trajectory_hash, c.trajectory_hash);
}

TEST(Lockstep, WithoutAPlannerTheRunEndsAndSaysSo) {
  const auto n = node(2);
  const scene::Scene s = test::four_link();
  auto arm = dynamics::DynamicsService::make(*n, s, {.patience = 50ms});
  ASSERT_TRUE(arm);
  const auto deadline = Clock::now() + 30s;
  while (!arm.value()->finished() && Clock::now() < deadline) {
    if (!arm.value()->poll(Clock::now())) n->wait(std::min(deadline, arm.value()->due()));
  }
  EXPECT_EQ(arm.value()->outcome(), dynamics::Outcome::no_command);
  EXPECT_EQ(arm.value()->arm().state().step, 0u);
}

// The planner is there and waits itself: who ends the run must name whom it lacks.
TEST(Lockstep, WithoutAPerceptionTheRunEndsAndNamesIt) {
  test::Said said;
  const auto n = node(15);
  const scene::Scene s = test::four_link();
  auto arm = made(dynamics::DynamicsService::make(*n, s, {.patience = 4s}));
  auto brain = made(planner::PlannerService::make(*n, s, {}));
  wire::Subscription<wire::PlannerReport> reports(*n);
  wire::PlannerReport r;
  for (auto now = Clock::now(); !arm->finished(); now += 10ms) {
    brain->poll(now);
    arm->poll(now);
    while (reports.take(r)) {
    }
  }
  EXPECT_EQ(arm->exit_code(), runtime::kNoData);
  const std::string waits = "step 0 waits for perception of arm 1";
  EXPECT_EQ(r.detail, waits);
  EXPECT_TRUE(said.has("[warning] " + waits)) << said.all();
  EXPECT_TRUE(said.has("step 0 waits for the planner of arm 1, 2 s so far; it says: " + waits) ||
              said.has("step 0 waits for the planner of arm 1, 3 s so far; it says: " + waits))
      << said.all();
  EXPECT_TRUE(said.has("no planner answered step 0 within 4 s; it says: " + waits)) << said.all();
}

TEST(Dynamics, CountsThePeriodsThatItWasStopped) {
  const auto n = node(16);
  wire::Subscription<wire::RunSummary> summaries(*n);
  auto arm = made(dynamics::DynamicsService::make(*n, test::four_link(), {.pace = scene::Pace::realtime}));
  auto now = Clock::now();
  for (int i = 0; i < 100; ++i) arm->poll(now += 1ms);
  const auto before = arm->arm().state().step;
  for (int i = 0; i < 100; ++i) arm->poll(now += i == 50 ? 300ms : 1ms);
  arm->close();
  wire::RunSummary last;
  while (summaries.take(last)) {
  }
  EXPECT_EQ(before, 100u);
  EXPECT_EQ(last.steps, 200u) << "what was missed is not made up for in a burst";
  EXPECT_EQ(last.deadlines_missed, 299u);
}

TEST(Dynamics, RefusesCommandsOfTheWrongSizeIncarnationOrEpoch) {
  const auto n = node(3);
  const scene::Scene s = test::four_link();
  wire::Publisher<wire::TorqueCommand> commands(*n);
  auto arm = dynamics::DynamicsService::make(*n, s, {});
  ASSERT_TRUE(arm);
  auto& d = *arm.value();
  wire::TorqueCommand good;
  good.arm = s.arm;
  good.epoch = 5;
  good.state_incarnation = 1;
  good.torque = wire::JointVector::Zero(4);
  const auto steps_after = [&](auto change) {
    wire::TorqueCommand c = good;
    c.step = d.arm().state().step;
    change(c);
    commands.publish(c);
    const auto before = d.arm().state().step;
    d.poll(Clock::now());
    return d.arm().state().step - before;
  };
  EXPECT_EQ(steps_after([](auto& c) {
              c.torque.resize(3);
              c.torque.setZero();
            }),
            0u);
  EXPECT_EQ(steps_after([](auto& c) { c.state_incarnation = 2; }), 0u);
  EXPECT_EQ(steps_after([](auto& c) { c.arm = 9; }), 0u);
  EXPECT_EQ(steps_after([](auto& c) { c.step += 1; }), 0u);
  EXPECT_EQ(steps_after([](auto&) {}), 1u);
  EXPECT_EQ(steps_after([](auto& c) { c.epoch = 4; }), 0u) << "a planner that was taken over from";
  EXPECT_EQ(steps_after([](auto& c) { c.epoch = 6; }), 1u) << "a planner that takes over";
}

// One wrong sample of an arm is not answered; an arm that stays where it leapt to is believed.
TEST(Planner, PassesOverASampleThatNoJointCouldReach) {
  const auto n = node(11);
  const scene::Scene s = test::shipped("panda_reach");
  wire::Publisher<wire::ArmState> states(*n);
  wire::Publisher<wire::ObstacleSet> sets(*n);
  wire::Subscription<wire::TorqueCommand> commands(*n);
  auto brain = planner::PlannerService::make(*n, s, {.pace = scene::Pace::realtime});
  ASSERT_TRUE(brain);
  wire::ObstacleSet none;
  none.source = s.arm, none.incarnation = 1;
  ASSERT_TRUE(sets.publish(none));
  std::vector<std::uint64_t> answered;
  const auto say = [&](std::uint64_t step, double leap) {
    ASSERT_TRUE(states.publish(test::arm_state(step, s.q0.array() + leap, s.arm)));
    brain.value()->poll(Clock::now());
    wire::TorqueCommand c;
    while (commands.take(c)) answered.push_back(c.step);
  };
  for (std::uint64_t k = 1; k <= 4; ++k) say(k, 0.001 * static_cast<double>(k));
  say(5, 0.3);
  for (std::uint64_t k = 6; k <= 7; ++k) say(k, 0.001 * static_cast<double>(k));
  for (std::uint64_t k = 8; k <= 12; ++k) say(k, 0.3);
  EXPECT_EQ(answered, (std::vector<std::uint64_t>{1, 2, 3, 4, 6, 7, 11, 12}));
}

// A client that sent a mode may leave once the arm obeys and the planner has said the mode's id.
TEST(Planner, SaysWhichModeItHasTaken) {
  const auto n = node(14);
  const scene::Scene s = test::shipped("panda_reach");
  wire::Publisher<wire::ModeCommand> modes(*n);
  wire::Subscription<wire::PlannerReport> reports(*n);
  auto brain = made(planner::PlannerService::make(*n, s, {.pace = scene::Pace::realtime}));
  wire::PlannerReport r;
  auto now = Clock::now();
  for (const auto& [id, mode] : {std::pair(7u, wire::Mode::hold), std::pair(9u, wire::Mode::resume)}) {
    ASSERT_TRUE(modes.publish({.arm = s.arm, .id = id, .mode = mode}));
    brain->poll(now += 200ms);
    while (reports.take(r)) {
    }
    EXPECT_EQ(r.mode_id, id);
  }
}

wire::ObstacleSet set(double t_s, double next_t_s, std::uint32_t source = 1, std::size_t n = 1) {
  wire::ObstacleSet s;
  s.source = source;
  s.t_s = t_s;
  s.next_t_s = next_t_s;
  s.sequence_number = static_cast<std::uint64_t>(t_s * 10);
  s.obstacles.resize(n);
  return s;
}

// Two cameras at different rates: what each saw keeps its own time, on which its speed is made out.
TEST(ObstacleView, EachObstacleIsAsOldAsItsOwnSet) {
  planner::ObstacleView v;
  v.add(set(0.1, 0.2, 1));
  v.add(set(0.15, 0.25, 2));
  wire::Causes causes;
  EXPECT_DOUBLE_EQ(v.at(0.18, Eigen::VectorXd::Zero(4), causes), 0.18 - 0.1);
  ASSERT_EQ(v.obstacles().size(), 2u);
  EXPECT_EQ(v.obstacles()[0].seen_s, 0.1);
  EXPECT_EQ(v.obstacles()[1].seen_s, 0.15);
}

TEST(ObstacleView, WaitsForTheSetThatCoversATime) {
  planner::ObstacleView v;
  EXPECT_FALSE(v.covers(0));
  v.add(set(0.2, 0.3));  // came early
  EXPECT_FALSE(v.covers(0.1));
  EXPECT_TRUE(v.covers(0.2));
  EXPECT_FALSE(v.covers(0.3)) << "a newer set may still come for it";
}

TEST(ObstacleView, UsesTheNewestSetThatIsNotFromTheFuture) {
  planner::ObstacleView v;
  wire::Causes causes;
  EXPECT_TRUE(std::isinf(v.at(0, {}, causes))) << "nothing ever arrived";
  v.add(set(0, 0.1, 1, 1));
  v.add(set(0.1, 0.2, 1, 2));
  EXPECT_DOUBLE_EQ(v.at(0.05, {}, causes), 0.05);
  EXPECT_EQ(v.obstacles().size(), 1u);
  EXPECT_DOUBLE_EQ(v.at(0.15, {}, causes), 0.15 - 0.1);
  EXPECT_EQ(v.obstacles().size(), 2u);
  v.add(set(0, 0.1, 1, 1));  // late: its successor is in use
  EXPECT_DOUBLE_EQ(v.at(0.15, {}, causes), 0.15 - 0.1);
  EXPECT_EQ(v.obstacles().size(), 2u);
}

TEST(ObstacleView, AnEmptySetIsSomethingElseThanNone) {
  planner::ObstacleView v;
  wire::Causes causes;
  v.add(set(0, wire::kInf, 1, 0));
  EXPECT_EQ(v.at(7, {}, causes), 0) << "it promised no successor: it does not age";
  EXPECT_TRUE(v.covers(7));
  EXPECT_TRUE(v.obstacles().empty());
}

TEST(ObstacleView, PutsSourcesTogetherAndIsAsOldAsTheOldest) {
  planner::ObstacleView v;
  wire::Causes causes;
  v.add(set(0.5, 1, 2, 3));
  v.add(set(0, 1, 1, 2));
  EXPECT_DOUBLE_EQ(v.at(0.6, {}, causes), 0.6);
  EXPECT_EQ(v.obstacles().size(), 5u);
  EXPECT_EQ(causes.size, 2u);
}

}  // namespace
