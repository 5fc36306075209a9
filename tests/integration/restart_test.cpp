/// Services that are killed and come back go on as if they had not been.  In process.

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <utility>

#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/service.h"
#include "tests/support/folder.h"
#include "tests/support/planner_scene.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::four_link;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

/// Two starts of a machine.
constexpr runtime::BootId kBoot{'o', 'n', 'e'}, kNextBoot{'t', 'w', 'o'};

/// Runs a scene in lockstep to `until`, all services new, with checkpoints in `folder`.
wire::RunSummary run_to(double until_s, const std::string& folder, std::uint32_t domain,
                        const runtime::BootId& boot = kBoot) {
  const auto n = node(domain);
  scene::Scene s = four_link({"planner.method=gyro"});
  s.duration_s = until_s;
  wire::Subscription<wire::RunSummary> summaries(*n);
  auto arm = dynamics::DynamicsService::make(*n, s, {.state_dir = folder, .boot = boot});
  auto eyes = perception::PerceptionService::make(*n, s);
  auto brain = planner::PlannerService::make(*n, s, {.state_dir = folder, .boot = boot});
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
  const test::Folder folder;
  const auto whole = run_to(1.0, "", 4);
  (void)run_to(0.4, folder.path(), 5);
  const auto resumed = run_to(1.0, folder.path(), 6);
  EXPECT_EQ(resumed.steps, 1000u);
  EXPECT_EQ(resumed.trajectory_hash, whole.trajectory_hash);
  EXPECT_EQ(resumed.energy_drift_rel, whole.energy_drift_rel);
}

/// The arm's machine loses power at 0.4 s; its disk knows the arm as it was at 0.2 s.
void lose_power(const std::string& folder, std::uint32_t domain) {
  const std::string file = folder + "/dynamics-1.checkpoint";
  (void)run_to(0.2, folder, domain);
  std::filesystem::copy_file(file, file + ".old");
  (void)run_to(0.4, folder, domain);
  std::filesystem::rename(file + ".old", file);
  std::filesystem::remove(file + ".durable");
}

TEST(Restart, AfterAPowerCutTheArmIsAnotherOneToItsPeersInLockstep) {
  const test::Folder folder;
  lose_power(folder.path(), 17);
  const auto resumed = run_to(1.0, folder.path(), 18, kNextBoot);
  EXPECT_EQ(resumed.incarnation, 2u);
  EXPECT_EQ(resumed.steps, 1000u);
  const auto again = run_to(1.1, folder.path(), 19, kNextBoot);
  EXPECT_EQ(again.incarnation, 2u) << "killed, not rebooted";
}

/// Real time over `seconds`, the test gives it: the states that were said.
std::vector<wire::ArmState> run_realtime(const scene::Scene& s, const std::string& folder, double seconds,
                                         const runtime::BootId& boot, std::uint32_t domain) {
  const auto n = node(domain);
  wire::Subscription<wire::ArmState> states(*n);
  auto now = Clock::now();
  auto arm = made(dynamics::DynamicsService::make(
      *n, s, {.pace = scene::Pace::realtime, .state_dir = folder, .boot = boot}));
  auto eyes = std::move(perception::PerceptionService::make(*n, s)).value();
  auto brain = made(planner::PlannerService::make(
      *n, s, {.pace = scene::Pace::realtime, .state_dir = folder, .boot = boot}));
  std::vector<wire::ArmState> all;
  for (int ms = 0; ms < static_cast<int>(1000 * seconds); ++ms) {
    arm->poll(now += 1ms);
    eyes->poll(now);
    brain->poll(now);
    for (wire::ArmState one; states.take(one);) all.push_back(one);
  }
  return all;
}

TEST(Restart, AfterAPowerCutTheArmIsAnotherOneToItsPeersInRealTime) {
  const test::Folder folder;
  const std::string file = folder.path() + "/dynamics-1.checkpoint";
  const scene::Scene s = four_link({"planner.method=gyro", "duration_s=60"});
  const auto first = run_realtime(s, folder.path(), 1, kBoot, 20);
  std::filesystem::copy_file(file, file + ".old");
  const auto lost = run_realtime(s, folder.path(), 1, kBoot, 21);
  EXPECT_EQ(lost.back().incarnation, first.back().incarnation) << "killed, not rebooted";
  std::filesystem::rename(file + ".old", file);
  std::filesystem::remove(file + ".durable");
  const auto after = run_realtime(s, folder.path(), 2, kNextBoot, 22);
  EXPECT_GT(after.front().incarnation, lost.back().incarnation);
  EXPECT_EQ(after.front().step, first.back().step) << "from where the disk knows it";
  EXPECT_EQ(after.front().position, first.back().position);
  EXPECT_EQ(after.back().validity, wire::Validity::valid) << "and it is driven again";
  EXPECT_NE(after[1].validity, wire::Validity::valid) << "no command of before the cut is obeyed";
  double jump = 0, most = 0;
  for (std::size_t k = 2; k < after.size(); ++k) {
    const double change = (after[k].torque_applied - after[k - 1].torque_applied).lpNorm<Eigen::Infinity>();
    if (k < 200) jump = std::max(jump, change);  // the ramp; the method's own changes are larger
    most = std::max(most, after[k].torque_applied.lpNorm<Eigen::Infinity>());
  }
  EXPECT_LE(jump, 0.1 * most) << "over a ramp";
}

// Whoever listens must not see a restart in what is said: the torque that was applied least of all.
TEST(Restart, AnArmThatComesBackSaysItsLastStateAgain) {
  const test::Folder folder;
  const auto n = node(13);
  const scene::Scene s = four_link({"duration_s=0.02"});
  wire::Subscription<wire::ArmState> states(*n);
  wire::Publisher<wire::TorqueCommand> commands(*n);
  wire::ArmState said, again;
  {
    auto arm = made(dynamics::DynamicsService::make(*n, s, {.state_dir = folder.path()}));
    const auto deadline = Clock::now() + 60s;
    while (!arm->finished() && Clock::now() < deadline) {
      arm->poll(Clock::now());
      while (states.take(said)) commands.publish(test::answer_to(said, 0.25));
    }
  }
  while (states.take(said)) {
  }
  ASSERT_EQ(said.step, 20u);
  EXPECT_NE(said.torque_applied[0], 0);
  auto arm = made(dynamics::DynamicsService::make(*n, s, {.state_dir = folder.path()}));
  arm->poll(Clock::now());
  ASSERT_TRUE(states.take(again));
  EXPECT_EQ(again.step, said.step);
  EXPECT_EQ(again.position, said.position);
  EXPECT_EQ(again.momentum, said.momentum);
  EXPECT_EQ(again.torque_applied, said.torque_applied);
  EXPECT_EQ(again.energy_J, said.energy_J);
  EXPECT_EQ(again.validity, said.validity);
}

/// A run in lockstep in which the planner looks for ways out; with `killed` it ends and another takes its
/// place as soon as it has asked for one.
wire::RunSummary run_with_escapes(bool killed, std::uint32_t domain) {
  const test::Folder folder;
  const auto n = node(domain);
  scene::Scene s = four_link({"dynamics.dt_s=0.002", "duration_s=12", "planner.method=gyro", "planner.kobs=0",
                              "planner.kc=0", "planner.vmax_mps=1"});
  s.robot = test::planar_arm(4, 1.0, 0.0);
  wire::Subscription<wire::RunSummary> summaries(*n);
  wire::Subscription<wire::PlannerReport> reports(*n);
  auto arm = made(dynamics::DynamicsService::make(*n, s, {}));
  auto eyes = perception::PerceptionService::make(*n, s);
  auto brain = made(planner::PlannerService::make(*n, s, {.state_dir = folder.path()}));
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
      brain = made(planner::PlannerService::make(*n, s, {.state_dir = folder.path()}));
    }
    if (!any) n->wait(arm->due());
  }
  EXPECT_GE(asked, 1u);
  arm->close();
  wire::RunSummary last;
  while (summaries.take(last)) {
  }
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
  const scene::Scene s = four_link({"planner.method=gyro"});
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
    const double q = 0.3 + 0.05 * static_cast<double>(k);
    wire::ArmState state = test::arm_state(k, Eigen::VectorXd::Constant(4, q), s.arm);
    state.velocity.setConstant(0.5);
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
  const test::Folder folder;
  const auto sent = answer(folder.path(), 0, 9, 7);
  const auto again = answer(folder.path(), 9, 9, 8);  // the arm still waits at the same state
  ASSERT_EQ(sent.step, 9u);
  ASSERT_EQ(again.step, 9u);
  EXPECT_EQ(std::memcmp(sent.torque.data(), again.torque.data(), 4 * sizeof(double)), 0);
  EXPECT_EQ(again.epoch, sent.epoch + 1);
  const auto next = answer(folder.path(), 10, 10, 9);
  const test::Folder another;
  const auto never_killed = answer(another.path(), 0, 10, 10);
  EXPECT_EQ(std::memcmp(next.torque.data(), never_killed.torque.data(), 4 * sizeof(double)), 0);
}

class Checkpoints : public testing::Test {
 protected:
  /// A planner answers one state; the epoch it says.
  std::uint64_t epoch_of(const scene::Scene& s) {
    const auto n = node(28);
    wire::Subscription<wire::TorqueCommand> commands(*n);
    wire::Publisher<wire::ArmState> arm(*n);
    wire::Publisher<wire::ObstacleSet> sets(*n);
    auto planner = made(planner::PlannerService::make(*n, s, {.state_dir = folder.path()}));
    wire::ObstacleSet set;
    set.source = s.arm;
    set.incarnation = 1;
    sets.publish(set);
    arm.publish(test::arm_state(++step, Eigen::VectorXd::Zero(4), s.arm));
    planner->poll(Clock::now());
    wire::TorqueCommand c;
    EXPECT_TRUE(commands.take(c));
    return c.epoch;
  }
  const test::Folder folder;
  std::uint64_t step = 0;
};

TEST_F(Checkpoints, OfAnotherSceneAreRefusedByThePlanner) {
  EXPECT_EQ(epoch_of(four_link()), 1u);
  EXPECT_EQ(epoch_of(four_link()), 2u) << "resumed: the next epoch";
  EXPECT_EQ(epoch_of(four_link({"planner.kp=26"})), 1u) << "another scene: afresh";
  std::filesystem::rename(folder.path() + "/planner-1.checkpoint.refused-1",
                          folder.path() + "/planner-1.checkpoint");
  EXPECT_EQ(epoch_of(four_link()), 3u) << "what was refused was kept";
}

TEST_F(Checkpoints, OfTheDynamicsKeepThePlaceThatIsHeld) {
  const scene::Scene s = four_link({"gravity_mps2=[0, -9.81, 0]"});
  Eigen::VectorXd whole, resumed;
  for (const bool restart : {false, true}) {
    for (const char* of : {"", ".durable"})
      std::filesystem::remove(folder.path() + "/dynamics-1.checkpoint" + of);
    const auto n = node(29);
    auto now = Clock::now();
    const dynamics::ServiceConfig config{.pace = scene::Pace::realtime, .state_dir = folder.path()};
    auto arm = made(dynamics::DynamicsService::make(*n, s, config));
    for (int i = 0; i < 50; ++i) arm->poll(now += 1ms);  // sags a little, and comes back
    if (restart) {
      arm.reset();
      arm = made(dynamics::DynamicsService::make(*n, s, config));
      now += 1ms;
      arm->poll(now);  // the first poll of a new one begins its clock
    }
    while (arm->arm().state().step < 200) arm->poll(now += 1ms);
    (restart ? resumed : whole) = arm->arm().state().q;
  }
  EXPECT_EQ(whole, resumed) << "bit for bit";
}

}  // namespace
