/// The services over the in-process bus, with a planner of the test's own.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <utility>

#include "common/files/scene_text.h"
#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/obstacle_view.h"
#include "services/planner/service.h"
#include "tests/support/planner_scene.h"
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
      wire::TorqueCommand c;
      c.arm = s.arm;
      c.epoch = 1;
      c.state_incarnation = s.incarnation;
      c.step = s.step;
      c.t_s = s.t_s;
      c.torque = wire::JointVector::Zero(s.position.size());
      c.torque[0] = 0.25;
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
  const scene::Scene s = test::shipped("four_link_avoid", {"duration_s=0.2"});
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
  const scene::Scene s = test::shipped("four_link_avoid");
  auto arm = dynamics::DynamicsService::make(*n, s, {.patience = 50ms});
  ASSERT_TRUE(arm);
  const auto deadline = Clock::now() + 30s;
  while (!arm.value()->finished() && Clock::now() < deadline) {
    if (!arm.value()->poll(Clock::now())) n->wait(std::min(deadline, arm.value()->due()));
  }
  EXPECT_EQ(arm.value()->outcome(), dynamics::Outcome::no_command);
  EXPECT_EQ(arm.value()->arm().state().step, 0u);
}

TEST(Dynamics, RefusesCommandsOfTheWrongSizeIncarnationOrEpoch) {
  const auto n = node(3);
  const scene::Scene s = test::shipped("four_link_avoid");
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

/// Runs a scene in lockstep to `until`, all services new, with checkpoints in `folder`.
wire::RunSummary run_to(double until_s, const std::string& folder, std::uint32_t domain) {
  const auto n = node(domain);
  scene::Scene s = test::shipped("four_link_avoid", {"planner.method=gyro"});
  s.duration_s = until_s;
  wire::Subscription<wire::RunSummary> summaries(*n);
  auto arm = dynamics::DynamicsService::make(*n, s, {.state_dir = folder});
  auto eyes = perception::PerceptionService::make(*n, s);
  auto brain = planner::PlannerService::make(*n, s, {.state_dir = folder});
  EXPECT_TRUE(arm && eyes && brain);
  const auto deadline = Clock::now() + 60s;
  while (!arm.value()->finished() && Clock::now() < deadline) {
    bool any = arm.value()->poll(Clock::now());
    any |= eyes.value()->poll(Clock::now());
    any |= brain.value()->poll(Clock::now());
    if (!any) n->wait(arm.value()->due());
  }
  EXPECT_EQ(arm.value()->outcome(), dynamics::Outcome::done);
  arm.value()->close();
  wire::RunSummary last;
  while (summaries.take(last)) {
  }
  return last;
}

TEST(Restart, InLockstepContinuesBitForBit) {
  const std::string folder = testing::TempDir() + "/hamel-restart-" + std::to_string(getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto whole = run_to(1.0, "", 4);
  (void)run_to(0.4, folder, 5);
  const auto resumed = run_to(1.0, folder, 6);
  EXPECT_EQ(resumed.steps, 1000u);
  EXPECT_EQ(resumed.trajectory_hash, whole.trajectory_hash);
  EXPECT_EQ(resumed.energy_drift_rel, whole.energy_drift_rel);
  std::filesystem::remove_all(folder);
}

// Whoever listens must not see a restart in what is said: the torque that was applied least of all.
TEST(Restart, AnArmThatComesBackSaysItsLastStateAgain) {
  const std::string folder = testing::TempDir() + "/hamel-again-" + std::to_string(getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto n = node(13);
  const scene::Scene s = test::shipped("four_link_avoid", {"duration_s=0.02"});
  wire::Subscription<wire::ArmState> states(*n);
  wire::ArmState said, again;
  {
    RelayedPlanner planner(*n, ~0ull);
    auto arm = made(dynamics::DynamicsService::make(*n, s, {.state_dir = folder}));
    const auto deadline = Clock::now() + 60s;
    while (!arm->finished() && Clock::now() < deadline) {
      arm->poll(Clock::now());
      planner.poll();
    }
  }
  while (states.take(said)) {
  }
  ASSERT_EQ(said.step, 20u);
  EXPECT_NE(said.torque_applied[0], 0);
  auto arm = made(dynamics::DynamicsService::make(*n, s, {.state_dir = folder}));
  arm->poll(Clock::now());
  ASSERT_TRUE(states.take(again));
  EXPECT_EQ(again.step, said.step);
  EXPECT_EQ(again.position, said.position);
  EXPECT_EQ(again.momentum, said.momentum);
  EXPECT_EQ(again.torque_applied, said.torque_applied);
  EXPECT_EQ(again.energy_J, said.energy_J);
  EXPECT_EQ(again.validity, said.validity);
  std::filesystem::remove_all(folder);
}

/// A run in lockstep in which the planner looks for ways out; with `killed` it ends and another takes its
/// place as soon as it has asked for one.
wire::RunSummary run_with_escapes(bool killed, std::uint32_t domain) {
  const std::string folder = testing::TempDir() + "/hamel-asked-" + std::to_string(getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto n = node(domain);
  scene::Scene s =
      test::shipped("four_link_avoid", {"dynamics.dt_s=0.002", "duration_s=12", "planner.method=gyro",
                                        "planner.kobs=0", "planner.kc=0", "planner.vmax_mps=1"});
  s.robot = test::planar_arm(4, 1.0, 0.0);
  wire::Subscription<wire::RunSummary> summaries(*n);
  wire::Subscription<wire::PlannerReport> reports(*n);
  auto arm = made(dynamics::DynamicsService::make(*n, s, {}));
  auto eyes = perception::PerceptionService::make(*n, s);
  auto brain = made(planner::PlannerService::make(*n, s, {.state_dir = folder}));
  wire::PlannerReport r;
  std::uint32_t asked = 0;
  const auto deadline = Clock::now() + 60s;
  while (!arm->finished() && Clock::now() < deadline) {
    bool any = arm->poll(Clock::now());
    any |= eyes.value()->poll(Clock::now());
    any |= brain->poll(Clock::now());
    bool more = false;
    while (reports.take(r)) more |= std::exchange(asked, r.escapes) < r.escapes;
    if (more && killed) {
      brain.reset();
      brain = made(planner::PlannerService::make(*n, s, {.state_dir = folder}));
    }
    if (!any) n->wait(arm->due());
  }
  EXPECT_GE(asked, 1u);
  arm->close();
  wire::RunSummary last;
  while (summaries.take(last)) {
  }
  std::filesystem::remove_all(folder);
  return last;
}

// A planner that dies with a question out leaves it in its checkpoint: the next one gets the same answer at
// the same step.
TEST(Restart, AQuestionOutlivesThePlannerThatAskedIt) {
  const auto whole = run_with_escapes(false, 15), killed = run_with_escapes(true, 16);
  EXPECT_EQ(whole.steps, 6000u);
  EXPECT_EQ(killed.trajectory_hash, whole.trajectory_hash);
}

/// A planner that answers states of a moving arm, with its checkpoint in `folder`; the last command it sends.
wire::TorqueCommand answer(const std::string& folder, std::uint64_t first, std::uint64_t last,
                           std::uint32_t domain) {
  const auto n = node(domain);
  const scene::Scene s = test::shipped("four_link_avoid", {"planner.method=gyro"});
  wire::Publisher<wire::ArmState> states(*n);
  wire::Publisher<wire::ObstacleSet> sets(*n);
  wire::Subscription<wire::TorqueCommand> commands(*n);
  auto brain = planner::PlannerService::make(*n, s, {.state_dir = folder});
  EXPECT_TRUE(brain);
  wire::ObstacleSet set;
  set.source = s.arm;
  set.incarnation = 1;
  set.obstacles.push_back(s.perception.obstacles[0].at_start);
  EXPECT_TRUE(sets.publish(set));
  wire::TorqueCommand newest;
  for (std::uint64_t k = first; k <= last; ++k) {
    wire::ArmState state;
    state.arm = s.arm;
    state.incarnation = 1;
    state.step = k;
    state.dt_s = 1e-3;
    state.t_s = 1e-3 * static_cast<double>(k);
    state.position = wire::JointVector::Constant(4, 0.3 + 0.05 * static_cast<double>(k));
    state.velocity = wire::JointVector::Constant(4, 0.5);
    state.momentum = state.torque_applied = wire::JointVector::Zero(4);
    EXPECT_TRUE(states.publish(state));
    brain.value()->poll(Clock::now());
    while (commands.take(newest)) {
    }
  }
  return newest;
}

// The checkpoint is written before the command is sent: a planner killed in between has answered nobody, and
// the next one must give that answer.
TEST(Restart, APlannerKilledBeforeItSpokeIsAnsweredFor) {
  const std::string folder = testing::TempDir() + "/hamel-spoke-" + std::to_string(getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto sent = answer(folder, 0, 9, 7);
  const auto again = answer(folder, 9, 9, 8);  // the arm still waits at the same state
  ASSERT_EQ(sent.step, 9u);
  ASSERT_EQ(again.step, 9u);
  EXPECT_EQ(std::memcmp(sent.torque.data(), again.torque.data(), 4 * sizeof(double)), 0);
  EXPECT_EQ(again.epoch, sent.epoch + 1);
  const auto next = answer(folder, 10, 10, 9);
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const auto never_killed = answer(folder, 0, 10, 10);
  EXPECT_EQ(std::memcmp(next.torque.data(), never_killed.torque.data(), 4 * sizeof(double)), 0);
  std::filesystem::remove_all(folder);
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
    wire::ArmState state;
    state.arm = s.arm, state.incarnation = 1, state.step = step, state.dt_s = 1e-3;
    state.t_s = 1e-3 * static_cast<double>(step);
    state.position = s.q0.array() + leap;
    state.velocity = state.momentum = state.torque_applied = wire::JointVector::Zero(7);
    ASSERT_TRUE(states.publish(state));
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
