// Targets: reached, and refused where an arm cannot or must not be.
#include <gtest/gtest.h>

#include "tests/support/planner_bench.h"

namespace hamel::test {
namespace {

using planner::Output;
using planner::Planner;
using planner::Reason;
using planner::State;
using scene::Method;
using Bench = PlannerBench;

TEST(Targets, UnreachableIsSaidAtOnceAndNotTried) {
  Bench b;
  b.goal.X_WG.p = {3, 3, 0};
  const Output out = b.plan();
  expect(out, State::stuck, Reason::unreachable);
  EXPECT_TRUE(out.torque_Nm.isZero());
}

TEST(Targets, AGoalInsideWhatStandsIsSaidAtOnceAndNotTriedUntilThatIsGone) {
  Bench b;
  b.obstacles = {sphere(1, b.goal.X_WG.p, 0.2)};
  for (const Method method : {Method::attract, Method::khatib, Method::gyro_paper, Method::gyro}) {
    b.options.method = method;
    const Output out = b.plan();
    expect(out, State::stuck, Reason::goal_blocked);
    const bool pushes = method == Method::khatib;  // whatever stands there
    EXPECT_EQ(out.torque_Nm.isZero(), !pushes);
  }
  const RunResult r = b.go(2);
  EXPECT_EQ(r.last.reason, Reason::goal_blocked);
  EXPECT_TRUE(r.qd.isZero());
  b.obstacles[0].V_WO[3] = 0.01;  // it may yet move out of the way
  expect(b.plan(), State::moving, Reason::none);
  b.obstacles = {sphere(1, b.goal.X_WG.p, 0.2)};
  b.obstacles[0].velocity_known = false;
  expect(b.plan(), State::moving, Reason::none);
  b.obstacles.clear();
  EXPECT_EQ(b.go(30).last.state, State::reached);
}

TEST(Targets, AGoalThatHasRoomBesideWhatStandsIsTried) {
  Bench b;
  b.obstacles = {sphere(1, b.goal.X_WG.p + Eigen::Vector3d(0, 0.35, 0), 0.2)};
  expect(b.plan(), State::moving, Reason::none);
}

// At a joint goal any link may be in the way, not the last alone.
TEST(Targets, AJointGoalInWhichALinkStandsInSomethingIsSaidAtOnce) {
  Bench b;
  b.goal.kind = scene::GoalKind::joints;
  b.goal.joints = Eigen::Vector4d(-0.5, 0.5, -0.5, 1);
  const Eigen::Vector3d along(std::cos(-0.5), std::sin(-0.5), 0);
  b.obstacles = {sphere(1, 0.7 * along, 0.1)};  // the first link, 5 cm thick
  const Output out = b.plan();
  expect(out, State::stuck, Reason::goal_blocked);
  EXPECT_TRUE(out.torque_Nm.isZero());
  b.obstacles = {sphere(1, 0.7 * along + Eigen::Vector3d(0, 0, 0.2), 0.1)};
  expect(b.plan(), State::moving, Reason::none);
  b.obstacles[0].X_WO.p = 0.7 * along;
  b.obstacles[0].V_WO[5] = 0.01;
  expect(b.plan(), State::moving, Reason::none);
}

TEST(Targets, BlockedGoalIsNamed) {
  Bench b;
  b.options.unreachable = scene::Unreachable::approach;
  b.obstacles = {sphere(1, b.goal.X_WG.p, 0.2)};
  const RunResult r = b.go(30);
  EXPECT_EQ(r.last.state, State::stuck);
  EXPECT_EQ(r.last.reason, Reason::goal_blocked);
  EXPECT_EQ(r.contact_at_s, -1);
}

TEST(Targets, NewGoalAfterReachedMovesOn) {
  Bench b;
  Planner p(b.robot, b.options);
  Output out = b.plan();
  b.goal.X_WG.p = out.report.end_effector_m;
  p.set_goal(b.goal);
  for (int k = 0; k < 200; ++k, b.t_s += 1e-3) p.plan(b.input(), out);
  EXPECT_EQ(out.report.state, State::reached);
  b.goal.id = 2;
  b.goal.X_WG.p[0] += 0.5;
  p.set_goal(b.goal);
  p.plan(b.input(), out);
  expect(out, State::moving, Reason::none);
  EXPECT_EQ(out.report.goal_id, 2u);
  EXPECT_LT(out.report.time_to_goal_s, 0);
  p.clear_goal();
  p.plan(b.input(), out);
  expect(out, State::idle, Reason::none);
}

TEST(Targets, JointTargetIsReached) {
  Bench b;
  b.goal.kind = scene::GoalKind::joints;
  b.goal.joints = Eigen::Vector4d(0.5, 0.5, -0.5, 1);
  b.options.vmax_mps = 1;
  const RunResult r = b.go(15);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_LT((r.q - b.goal.joints).lpNorm<Eigen::Infinity>(), 0.01);
}

TEST(Targets, PoseIsReachedInOrientationToo) {
  Bench b;
  b.goal.kind = scene::GoalKind::pose;
  b.goal.X_WG.R = Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const RunResult r = b.go(15);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_LT(r.last.orientation_error_rad, 0.02);
  EXPECT_NEAR(std::remainder(r.q.sum() - 2.5, 2 * M_PI), 0, 0.02);
}

TEST(Targets, MovingTargetIsFollowed) {
  Bench b;
  b.goal.V_WG.tail<3>() = Eigen::Vector3d(-0.1, 0, 0);
  const RunResult r = b.go(8);
  EXPECT_LT(r.last.target_error_m, 0.01);
}

}  // namespace
}  // namespace hamel::test
