/// Who is heard where several speak: arms, obstacle sources, runs, versions.  In process, the test gives the
/// time.

#include <gtest/gtest.h>

#include "common/runtime/options.h"
#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/service.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::four_link;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

/// Several dynamics for one arm on one domain, polled in turn.
TEST(Arms, OfTwoThatAreNewTheLaterEnds) {
  const auto n = node(24);
  const scene::Scene s = four_link();
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
  const scene::Scene s = four_link();
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
  const scene::Scene s = four_link();
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
    from.publish(test::arm_state(step, Eigen::Vector4d(q0, 0, 0, 0), 1, incarnation));
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
  std::unique_ptr<planner::PlannerService> planner = made(planner::PlannerService::make(*n, four_link(), {}));
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
    const scene::Scene one = four_link({"planner.method=gyro"}),
                       two = four_link({"arm=2", "planner.method=gyro"});
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
