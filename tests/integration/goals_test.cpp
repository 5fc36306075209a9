/// Goals that come while an arm is driven: whether they can be reached is looked at beside the loop.

#include <gtest/gtest.h>

#include <string>

#include "services/planner/core/reachable.h"
#include "services/planner/service.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kLook = 20;                       ///< steps of 1 ms until an answer enters
const Eigen::Vector3d kNear(1, 2.5, 0), kFar(1, 2, 0.5);  ///< kFar: beside the plane of the arm

/// A planner of example 5.2 whose arm bends at a steady rate; its time is the test's.
class Driven {
 public:
  explicit Driven(std::uint32_t domain, scene::Pace pace = scene::Pace::realtime)
      : node_(node(domain)),
        goals_(*node_),
        states_(*node_),
        sets_(*node_),
        reports_(*node_),
        commands_(*node_),
        planner_(made(planner::PlannerService::make(*node_, scene_, {.pace = pace, .patient = true}))) {
    wire::ObstacleSet set;
    set.source = scene_.arm, set.incarnation = 1;
    set.obstacles.push_back(scene_.perception.obstacles[0].at_start);
    EXPECT_TRUE(sets_.publish(set));
  }
  void ask(std::uint64_t id, const Eigen::Vector3d& p_m) {
    wire::Goal g;
    g.arm = scene_.arm;
    g.id = id;
    g.kind = wire::GoalKind::position;
    g.position_m = p_m;
    EXPECT_TRUE(goals_.publish(g));
  }
  /// One step of the arm, answered.
  const wire::PlannerReport& step() {
    ++k_;
    Eigen::VectorXd q(4);
    q << 0.1, 0.4, 0.4, 0.4;
    wire::ArmState s = test::arm_state(k_, q.array() + 2e-4 * static_cast<double>(k_), scene_.arm);
    s.velocity.setConstant(0.2);
    EXPECT_TRUE(states_.publish(s));
    return poll();
  }
  const wire::PlannerReport& poll() {
    planner_->poll(now_ += 20ms);  // longer than the period of reports: each step gives one
    while (reports_.take(report_)) {
    }
    while (commands_.take(command_)) {
    }
    return report_;
  }
  bool looks() const { return report_.detail.starts_with("looking"); }
  const Eigen::VectorXd torque() const { return command_.torque; }

 private:
  const scene::Scene scene_ = test::four_link({"planner.method=gyro"});
  std::unique_ptr<bus::Node> node_;
  wire::Publisher<wire::Goal> goals_;
  wire::Publisher<wire::ArmState> states_;
  wire::Publisher<wire::ObstacleSet> sets_;
  wire::Subscription<wire::PlannerReport> reports_;
  wire::Subscription<wire::TorqueCommand> commands_;
  std::unique_ptr<planner::PlannerService> planner_;
  wire::PlannerReport report_;
  wire::TorqueCommand command_;
  Clock::time_point now_ = Clock::now();
  std::uint64_t k_ = 0;
};

// Until the answer enters the arm does what it would do had nobody asked.
TEST(Goals, InRealTimeNoCycleSearchesAndTheAnswerEntersAtItsStep) {
  for (const bool far : {true, false}) {
    Driven arm(200), left_alone(201);
    const std::uint64_t searched = planner::goals_searched();
    for (int k = 0; k < 5; ++k) arm.step(), left_alone.step();
    arm.ask(2, far ? kFar : kNear);
    for (std::uint64_t k = 0; k < kLook; ++k) {
      const wire::PlannerReport &r = arm.step(), &before = left_alone.step();
      ASSERT_TRUE(arm.looks()) << r.detail;
      ASSERT_EQ(r.goal_id, 1u) << k;
      ASSERT_EQ(r.state, before.state);
      ASSERT_EQ(arm.torque(), left_alone.torque()) << k;
    }
    const wire::PlannerReport& r = arm.step();
    EXPECT_FALSE(arm.looks());
    EXPECT_EQ(r.goal_id, 2u);
    EXPECT_EQ(r.reason, far ? wire::Reason::unreachable : wire::Reason::none);
    EXPECT_EQ(r.state, far ? wire::PlannerState::stuck : wire::PlannerState::moving);
    EXPECT_EQ(planner::goals_searched(), searched) << "on this thread";
  }
}

TEST(Goals, InLockstepTheGoalHoldsInTheCycleThatHearsIt) {
  Driven arm(202, scene::Pace::lockstep);
  arm.step();
  const std::uint64_t searched = planner::goals_searched();
  arm.ask(2, kFar);
  const wire::PlannerReport& r = arm.step();
  EXPECT_EQ(r.goal_id, 2u);
  EXPECT_EQ(r.reason, wire::Reason::unreachable);
  EXPECT_EQ(planner::goals_searched(), searched + 1);
}

TEST(Goals, ANewerOneTakesThePlaceOfOneThatIsLookedAt) {
  Driven arm(203);
  arm.step();
  arm.ask(2, kFar);
  for (int k = 0; k < 10; ++k) EXPECT_EQ(arm.step().goal_id, 1u);
  arm.ask(3, kNear);
  for (std::uint64_t k = 0; k < kLook; ++k) EXPECT_EQ(arm.step().goal_id, 1u);
  const wire::PlannerReport& r = arm.step();
  EXPECT_EQ(r.goal_id, 3u);
  EXPECT_EQ(r.state, wire::PlannerState::moving);
}

// However often it does, the answer about it comes.
TEST(Goals, ATargetThatMovesOnIsFollowedMeanwhile) {
  Driven arm(204);
  arm.step();
  const std::uint64_t searched = planner::goals_searched();
  double error_m = 0;
  for (std::uint64_t k = 0; k <= kLook; ++k) {
    arm.ask(1, kFar + 0.01 * static_cast<double>(k) * Eigen::Vector3d::UnitZ());
    const wire::PlannerReport& r = arm.step();
    EXPECT_FALSE(arm.looks());
    EXPECT_GT(r.target_error_m, error_m) << k;
    error_m = r.target_error_m;
    EXPECT_EQ(r.reason == wire::Reason::unreachable, k >= kLook) << k;
  }
  for (std::uint64_t k = 0; k <= kLook; ++k) {
    arm.ask(1, kNear);
    EXPECT_EQ(arm.step().reason == wire::Reason::unreachable, k < kLook) << k;
  }
  EXPECT_EQ(planner::goals_searched(), searched) << "on this thread";
}

TEST(Goals, WhereNoCycleComesTheAnswerEntersAllTheSame) {
  Driven arm(205);
  arm.step();
  arm.ask(2, kFar);
  arm.poll();
  const auto deadline = Clock::now() + 60s;
  for (int k = 0; k < 20 || (arm.poll().goal_id != 2 && Clock::now() < deadline); ++k) arm.poll();
  EXPECT_EQ(arm.poll().goal_id, 2u);
}

}  // namespace
