/// Who is heard where several speak: planners, arms, obstacle sources, runs, versions.  In process, the test
/// gives the time.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "common/runtime/options.h"
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

scene::Scene load(const std::vector<std::string>& overrides = {}) {
  return test::shipped("four_link_avoid", overrides);
}

/// A planner of the test's own: one writer of commands.
struct Commander {
  explicit Commander(bus::Node& n) : out(n) {}
  void say(const dynamics::DynamicsService& d, std::uint64_t epoch, std::uint64_t incarnation,
           double torque_Nm) {
    wire::TorqueCommand c;
    c.arm = 1;
    c.epoch = epoch;
    c.state_incarnation = incarnation;
    c.step = d.arm().state().step;
    c.torque = wire::JointVector::Zero(4);
    c.torque[0] = torque_Nm;
    out.publish(c);
  }
  wire::Publisher<wire::TorqueCommand> out;
};

class Planners : public testing::Test {
 protected:
  /// Each polled once in this order; the torque that the arm was given over the next step.
  double applied(std::vector<std::pair<Commander*, std::pair<std::uint64_t, double>>> said) {
    const auto before = arm->arm().state().step;
    for (const auto& [who, what] : said) who->say(*arm, what.first, 1, what.second);
    arm->poll(now += 1ms);
    EXPECT_EQ(arm->arm().state().step, before + 1);
    return arm->arm().torque_applied()[0];
  }
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = node(21);
  scene::Scene s = load();
  std::unique_ptr<dynamics::DynamicsService> arm = made(dynamics::DynamicsService::make(*n, s, {}));
  Commander a{*n}, b{*n};
};

TEST_F(Planners, OfEqualEpochsTheOneThatHasTheArmKeepsIt) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(applied({{&b, {1, 0.2}}, {&a, {1, 0.1}}}), 0.1) << "never mixed";
}

TEST_F(Planners, TheLargerEpochTakesOverAndStays) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  EXPECT_EQ(applied({{&b, {2, 0.2}}, {&a, {1, 0.1}}}), 0.2);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.2) << "never mixed";
}

TEST_F(Planners, ASlowStrongerOneTakesOverToo) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.1) << "this step was answered";
  EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.2);
}

/// In real time: `drive` of `from`, until the arm is at `step`.
class RealTime : public testing::Test {
 protected:
  void poll() { arm->poll(now += 1ms); }
  std::uint64_t incarnation() {
    wire::ArmState state;
    while (states.take(state)) last = state;
    return last.incarnation;
  }
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = node(22);
  scene::Scene s = load({"gravity_mps2=[0, 0, 0]"});
  wire::Subscription<wire::ArmState> states{*n};
  wire::ArmState last;
  std::unique_ptr<dynamics::DynamicsService> arm =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime}));
  Commander a{*n}, b{*n};
};

TEST_F(RealTime, AWeakerPlannerTakesOverOnceTheStrongerIsSilent) {
  poll();
  for (int i = 0; i < 100; ++i) {
    a.say(*arm, 9, incarnation(), 0.1);
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
  }
  wire::ArmState state;
  for (int i = 0; i < 300; ++i) {
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
    if (i == 40) {
      EXPECT_EQ(last.validity, wire::Validity::valid) << "the last command of a is not stale yet";
    }
  }
  incarnation();
  EXPECT_EQ(last.validity, wire::Validity::valid);
  EXPECT_NEAR(last.torque_applied[0], 0.2, 1e-12);
  for (int i = 0; i < 300; ++i) {
    a.say(*arm, 9, incarnation(), 0.1);
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
  }
  incarnation();
  EXPECT_NEAR(last.torque_applied[0], 0.1, 1e-12) << "the stronger one is back";
}

TEST_F(RealTime, AfterASilenceTheCommandComesInOverTheRampWithoutAJump) {
  for (int i = 0; i < 10; ++i) poll();
  a.say(*arm, 1, incarnation(), 1.0);
  poll();
  incarnation();
  EXPECT_EQ(last.torque_applied[0], 1) << "the run's first command starts it";
  for (int i = 0; i < 400; ++i) poll();
  incarnation();
  EXPECT_EQ(last.validity, wire::Validity::command_stale);
  EXPECT_LT(last.velocity.lpNorm<Eigen::Infinity>(), 1e-3) << "it holds";
  double before = last.torque_applied[0], most = 0;
  for (int i = 0; i < 400; ++i) {
    a.say(*arm, 1, incarnation(), 1.0);
    poll();
    incarnation();
    most = std::max(most, std::abs(last.torque_applied[0] - before));
    before = last.torque_applied[0];
  }
  EXPECT_NEAR(before, 1, 1e-12);
  EXPECT_LT(most, 1.0 / 200 * 10) << "share rises by 1/200 a step, the arm's own motion adds a little";
}

TEST(Silence, TheSceneSaysWhetherTheArmHoldsOrOnlyBrakes) {
  for (const char* safe : {"hold", "brake"}) {
    const auto n = node(23);
    const scene::Scene s = load({"gravity_mps2=[0, -9.81, 0]", std::string("dynamics.on_silence=") + safe});
    auto arm = made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime}));
    wire::Subscription<wire::ArmState> states(*n);
    Commander a(*n);
    wire::ArmState state;
    auto now = Clock::now();
    for (int i = 0; i < 300; ++i) {
      while (states.take(state)) {
      }
      a.say(*arm, 1, state.incarnation, 3);
      arm->poll(now += 1ms);
    }
    EXPECT_GT(arm->arm().state().qd.lpNorm<Eigen::Infinity>(), 0.1) << safe;
    // Once nothing drives it, the arm only loses speed: it does not swing back to where it was told to stop.
    double before_J = scene::kInf, risen_J = 0;
    for (int i = 0; i < 1000; ++i) {
      arm->poll(now += 1ms);
      while (states.take(state)) {
      }
      if (state.validity != wire::Validity::command_stale) continue;
      const double kinetic_J = 0.5 * state.momentum.dot(state.velocity);
      risen_J = std::max(risen_J, kinetic_J - before_J);
      before_J = kinetic_J;
    }
    EXPECT_LT(risen_J, 1e-6) << safe << ": what is left below 0.02 rad/s may swing";
    const Eigen::VectorXd there = arm->arm().state().q;
    EXPECT_LT(arm->arm().state().qd.lpNorm<Eigen::Infinity>(), 1e-3) << safe;
    for (int i = 0; i < 1000; ++i) arm->poll(now += 1ms);
    EXPECT_LT((arm->arm().state().q - there).lpNorm<Eigen::Infinity>(), 1e-3) << safe << ": gravity is held";
  }
}

/// Several dynamics for one arm on one domain, polled in turn.
TEST(Arms, OfTwoThatAreNewTheLaterEnds) {
  const auto n = node(24);
  const scene::Scene s = load();
  auto first =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime, .incarnation = 5}));
  auto second =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime, .incarnation = 6}));
  auto now = Clock::now();
  for (int i = 0; i < 100; ++i) {
    second->poll(now += 1ms);
    first->poll(now);
  }
  EXPECT_EQ(first->outcome(), dynamics::Outcome::running);
  EXPECT_EQ(second->outcome(), dynamics::Outcome::not_alone);
  EXPECT_EQ(second->exit_code(), runtime::kBadInput);
}

TEST(Arms, OneThatHasRunForLongStaysWhateverItsIncarnation) {
  const auto n = node(25);
  const scene::Scene s = load();
  auto first =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime, .incarnation = 9}));
  auto now = Clock::now();
  for (int i = 0; i < 4000; ++i) first->poll(now += 1ms);
  auto second =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime, .incarnation = 2}));
  for (int i = 0; i < 100; ++i) {
    second->poll(now += 1ms);
    first->poll(now);
  }
  EXPECT_EQ(first->outcome(), dynamics::Outcome::running);
  // The second is the smaller of two new ones, so it does not end by itself; hamel up has looked before.
  auto third =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime, .incarnation = 10}));
  for (int i = 0; i < 100; ++i) {
    third->poll(now += 1ms);
    first->poll(now);
  }
  EXPECT_EQ(first->outcome(), dynamics::Outcome::running);
  EXPECT_EQ(third->outcome(), dynamics::Outcome::not_alone);
}

TEST(Arms, InLockstepToTheSecondOfTwoEqualOnesEnds) {
  const auto n = node(26);
  const scene::Scene s = load();
  auto a = made(dynamics::DynamicsService::make(*n, s, {}));
  auto b = made(dynamics::DynamicsService::make(*n, s, {}));
  auto now = Clock::now();
  for (int i = 0; i < 100; ++i) {
    a->poll(now += 10ms);
    b->poll(now);
  }
  const bool one =
      (a->outcome() == dynamics::Outcome::not_alone) != (b->outcome() == dynamics::Outcome::not_alone);
  EXPECT_TRUE(one);
}

/// A planner and what the test tells it.
class OnePlanner : public testing::Test {
 protected:
  void state(wire::Publisher<wire::ArmState>& from, std::uint64_t incarnation, std::uint64_t step,
             double q0) {
    wire::ArmState m;
    m.arm = 1;
    m.incarnation = incarnation;
    m.step = step;
    m.dt_s = 0.001;
    m.t_s = 0.001 * static_cast<double>(step);
    m.position = m.velocity = m.momentum = m.torque_applied = wire::JointVector::Zero(4);
    m.position[0] = q0;
    from.publish(m);
  }
  void obstacles(std::uint64_t incarnation, double t_s, std::uint32_t source = 1) {
    wire::ObstacleSet m;
    m.source = source;
    m.incarnation = incarnation;
    m.sequence_number = 1;
    m.t_s = t_s;
    sets.publish(m);
  }
  /// The states answered since the last call: (incarnation, step).
  std::vector<std::pair<std::uint64_t, std::uint64_t>> answered() {
    planner->poll(now += 10ms);
    std::vector<std::pair<std::uint64_t, std::uint64_t>> all;
    wire::TorqueCommand c;
    while (commands.take(c)) all.emplace_back(c.state_incarnation, c.step);
    return all;
  }
  using Answers = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = node(27);
  wire::Subscription<wire::TorqueCommand> commands{*n};
  wire::Publisher<wire::ArmState> arm{*n}, other{*n};
  wire::Publisher<wire::ObstacleSet> sets{*n};
  std::unique_ptr<planner::PlannerService> planner = made(planner::PlannerService::make(*n, load(), {}));
};

TEST_F(OnePlanner, HearsNoOtherArmOfItsKeyWhileItsOwnSpeaks) {
  obstacles(7, 0);
  state(arm, 7, 1, 0);
  EXPECT_EQ(answered(), (Answers{{7, 1}}));
  state(other, 6, 2, 0);
  EXPECT_EQ(answered(), Answers{}) << "an earlier run";
  state(other, 8, 2, 0);
  EXPECT_EQ(answered(), Answers{}) << "a later run, and still ours speaks";
  now += 300ms;
  obstacles(8, 0);
  state(other, 8, 3, 0);
  EXPECT_EQ(answered(), (Answers{{8, 3}})) << "ours is silent";
}

TEST_F(OnePlanner, IgnoresObstaclesOfAnEarlierRun) {
  obstacles(7, 0);
  state(arm, 7, 1, 0);
  EXPECT_EQ(answered().size(), 1u);
  now += 300ms;
  state(arm, 8, 1, 0);
  EXPECT_EQ(answered(), Answers{}) << "lockstep waits for the obstacles of this run";
  obstacles(7, 0.5);
  EXPECT_EQ(answered(), Answers{}) << "those of the earlier run are none";
  obstacles(8, 0);
  EXPECT_EQ(answered(), (Answers{{8, 1}}));
}

TEST_F(OnePlanner, SeesOnlyWhatItsOwnPerceptionsSee) {
  obstacles(7, 0, 2);
  state(arm, 7, 1, 0);
  EXPECT_EQ(answered(), Answers{}) << "source 2 sees for arm 2";
  obstacles(7, 0, 1 + (3u << 28));
  EXPECT_EQ(answered(), (Answers{{7, 1}})) << "the fourth source of arm 1";
}

TEST_F(OnePlanner, DoesNotSpinOnSilence) {
  planner->poll(now += 1s);
  EXPECT_FALSE(planner->poll(now)) << "nothing came: nothing is done";
  EXPECT_GE(planner->due(), now + 90ms) << "and nothing is due at once";
}

class Checkpoints : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "/hamel-arbitration-XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  /// A planner answers one state; the epoch it says.
  std::uint64_t epoch_of(const scene::Scene& s) {
    const auto n = node(28);
    wire::Subscription<wire::TorqueCommand> commands(*n);
    wire::Publisher<wire::ArmState> arm(*n);
    wire::Publisher<wire::ObstacleSet> sets(*n);
    auto planner = made(planner::PlannerService::make(*n, s, {.state_dir = folder}));
    wire::ObstacleSet set;
    set.source = s.arm;
    set.incarnation = 1;
    sets.publish(set);
    wire::ArmState m;
    m.arm = s.arm;
    m.incarnation = 1;
    m.dt_s = 0.001;
    m.step = ++step;
    m.t_s = 0.001 * static_cast<double>(step);
    m.position = m.velocity = m.momentum = m.torque_applied = wire::JointVector::Zero(4);
    arm.publish(m);
    planner->poll(Clock::now());
    wire::TorqueCommand c;
    EXPECT_TRUE(commands.take(c));
    return c.epoch;
  }
  std::string folder;
  std::uint64_t step = 0;
};

TEST_F(Checkpoints, OfAnotherSceneAreRefusedByThePlanner) {
  EXPECT_EQ(epoch_of(load()), 1u);
  EXPECT_EQ(epoch_of(load()), 2u) << "resumed: the next epoch";
  EXPECT_EQ(epoch_of(load({"planner.kp=26"})), 1u) << "another scene: afresh";
}

TEST_F(Checkpoints, OfTheDynamicsKeepThePlaceThatIsHeld) {
  const scene::Scene s = load({"gravity_mps2=[0, -9.81, 0]"});
  Eigen::VectorXd whole, resumed;
  for (const bool restart : {false, true}) {
    std::filesystem::remove(folder + "/dynamics-1.checkpoint");
    const auto n = node(29);
    auto now = Clock::now();
    const dynamics::ServiceConfig config{.pace = scene::Pace::realtime, .state_dir = folder};
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

/// What a service says of its peers.
TEST(Presence, NamesAPeerOfAnotherIdlAndASecondOfItsName) {
  const auto n = node(30);
  runtime::Presence ours(*n, wire::ServiceKind::planner, 1),
      double_of_ours(*n, wire::ServiceKind::planner, 1), friendly(*n, wire::ServiceKind::dynamics, 1);
  wire::Publisher<wire::ServiceStatus> stranger(*n);
  wire::Subscription<wire::ServiceStatus> statuses(*n);
  wire::ServiceStatus foreign;
  foreign.kind = wire::ServiceKind::perception;
  foreign.arm = 1;
  foreign.version = "hamel 9";
  foreign.idl_hash = "0123456789abcdef";
  const auto now = Clock::now();
  friendly.say(now, {});
  ours.say(now, {});
  EXPECT_EQ(ours.strangers() + ours.doubles(), 0u);
  double_of_ours.say(now, {});
  stranger.publish(foreign);
  stranger.publish(foreign);
  ours.say(now, {});
  EXPECT_EQ(ours.strangers(), 1u) << "each peer once";
  EXPECT_EQ(ours.doubles(), 1u);
  wire::ServiceStatus said, last;
  while (statuses.take(said)) last = said;
  EXPECT_EQ(last.state, wire::ServiceState::degraded);
}

/// Two arms in one process on one bus: a goal for one never moves the other.
TEST(TwoArms, AGoalForOneDoesNotMoveTheOther) {
  const auto run = [](bool with_second) {
    const auto n = node(31);
    const scene::Scene one = load({"planner.method=gyro"}), two = load({"arm=2", "planner.method=gyro"});
    std::vector<std::unique_ptr<runtime::Service>> services;
    auto arm = made(dynamics::DynamicsService::make(*n, one, {}));
    auto& first = *arm;
    services.push_back(std::move(arm));
    for (const auto* s : {&one, &two}) {
      if (s == &two && !with_second) break;
      if (s == &two) services.push_back(made(dynamics::DynamicsService::make(*n, two, {})));
      services.push_back(std::move(perception::PerceptionService::make(*n, *s)).value());
      services.push_back(made(planner::PlannerService::make(*n, *s, {})));
    }
    wire::Publisher<wire::Goal> goals(*n);
    wire::Goal g;
    g.arm = 2;
    g.id = 7;
    g.position_m = {1, -2, 0};
    goals.publish(g);
    wire::Publisher<wire::ModeCommand> modes(*n);
    modes.publish({.arm = 2, .id = 1, .mode = wire::Mode::hold});
    auto now = Clock::now();
    const auto deadline = now + 60s;
    while (first.arm().state().step < 500 && Clock::now() < deadline)
      for (const auto& s : services) s->poll(now += 1us);
    EXPECT_GE(first.arm().state().step, 500u);
    return Eigen::VectorXd(first.arm().state().q);
  };
  // Steps come in bursts: compare at the same step.
  EXPECT_EQ(run(false), run(true));
}

}  // namespace
