// The state machine: every state and reason, and what the torque does in it.
#include <gtest/gtest.h>

#include <string>

#include "common/rbd/rbd.h"
#include "services/planner/core/monitor.h"
#include "tests/support/planner_bench.h"

namespace hamel::test {
namespace {

using planner::Input;
using planner::Output;
using planner::Planner;
using planner::Reason;
using planner::State;
using scene::Method;
using Bench = PlannerBench;

TEST(States, IdleWithoutGoalOnlyDamps) {
  Bench b;
  b.qd.setConstant(0.1);
  b.options.barrier_gain = 0;
  const Output out = b.plan(false);
  expect(out, State::idle, Reason::none);
  EXPECT_LT(out.torque_Nm.dot(b.qd), 0);
}

TEST(States, MovingToReachedAfterStayingThere) {
  const Bench b;
  expect(b.plan(), State::moving, Reason::none);
  const RunResult r = b.go(10);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_GT(r.reached_at_s, 0.5);
  EXPECT_GT(r.last.path_length_m, 0.7);
}

TEST(States, GoalAtTheStartIsReachedAfterTheHold) {
  Bench b;
  Planner p(b.robot, b.options);
  Output out = b.plan();
  b.goal.X_WG.p = out.report.end_effector_m;
  p.set_goal(b.goal);
  for (int k = 0; k <= 101; ++k, b.t_s = k * 1e-3) {
    p.plan(b.input(), out);
    EXPECT_EQ(out.report.state == State::reached, b.t_s >= 0.1 - 1e-12) << b.t_s;
  }
}

TEST(States, ContactIsUnsafeAndBrakesUntilClear) {
  Bench b;
  b.qd.setConstant(0.5);
  b.options.method = Method::attract;
  Planner p(b.robot, b.options);
  p.set_goal(b.goal);
  Output out = p.output();
  b.obstacles[0] = sphere(1, {0.5, 0.2, 0}, 0.2);
  p.plan(b.input(), out);
  expect(out, State::unsafe, Reason::contact);
  EXPECT_LT(out.torque_Nm.dot(b.qd), 0);
  EXPECT_EQ(out.report.contacts, 1u);
  b.obstacles[0] = sphere(1, {0.5, 0.255, 0}, 0.2);  // 5 mm: free, yet nearer than dmin
  p.plan(b.input(), out);
  expect(out, State::unsafe, Reason::contact);
  b.obstacles[0] = sphere(1, {0.5, 0.27, 0}, 0.2);
  p.plan(b.input(), out);
  expect(out, State::moving, Reason::none);
  EXPECT_NEAR(out.report.clearance_min_m, -0.05, 1e-12);
}

TEST(States, BrakeStopsWithinATenthOfASecond) {
  Bench b;
  b.qd = Eigen::Vector4d(2, -3, 1, 4);
  b.state_age_s = 1;
  Planner p(b.robot, b.options);
  p.set_goal(b.goal);
  Output out = p.output();
  for (const double dt_s : {1e-3, 0.02}) {
    scene::DynamicsOptions o;
    o.dt_s = b.dt_s = dt_s;
    dynamics::Integrator dynamics(b.robot.chain, o);
    dynamics::State s = dynamics.start(b.q, b.qd);
    for (double t = 0; t < 0.1 - 1e-9; t += dt_s) {
      const Input in{.dt_s = dt_s, .q = s.q, .qd = s.qd, .obstacles = {}, .state_age_s = 1};
      p.plan(in, out);
      expect(out, State::unsafe, Reason::stale_state);
      ASSERT_TRUE(dynamics.step(s, out.torque_Nm).usable());
    }
    EXPECT_LT(s.qd.lpNorm<Eigen::Infinity>(), 0.02) << dt_s;
  }
}

// Whatever the joints are asked for: no more than they have, with what holds the arm up.
TEST(States, BrakingKeepsTheTorqueLimits) {
  Random rng(12);
  int bound = 0;
  for (int k = 0; k < 200; ++k) {
    model::ChainSpec spec = random_spec(rng, 5);
    for (model::Joint& j : spec.joints) j.limits.effort = rng.uniform(5, 100);
    const scene::Robot robot{"r", "", checked(std::move(spec)), {}};
    Planner p(robot, {});
    Output out = p.output();
    const Eigen::VectorXd q = rng.vector(5, 1), qd = rng.vector(5, 3);
    p.plan({.q = q, .qd = qd, .obstacles = {}, .state_age_s = 1}, out);
    expect(out, State::unsafe, Reason::stale_state);
    rbd::Workspace ws(robot.chain);
    Eigen::VectorXd gravity(5);
    rbd::positions(robot.chain, q + 0.5e-3 * qd, ws);
    rbd::gravity_torque(robot.chain, ws, gravity);
    for (int j = 0; j < 5; ++j) {
      const double limit = robot.chain.joint(j).limits.effort, all = std::abs(out.torque_Nm[j] + gravity[j]);
      EXPECT_LE(all, limit + 0.1) << k;
      bound += all > limit - 0.1;
    }
  }
  EXPECT_GT(bound, 200);
}

// The barrier leaves more room than braking takes: wherever on its way the arm is told to stop, it stops in
// time.
TEST(States, BrakingFromBehindTheBarrierTouchesNothing) {
  Bench b;
  b.options.vmax_mps = 2;
  b.options.kobs = b.options.kc = 0;
  b.options.escapes = 0;
  b.obstacles = {sphere(1, {1.8, 2.2, 0}, 0.3)};  // straight on the way
  Planner p(b.robot, b.options);
  p.set_goal(b.goal);
  Output out = p.output();
  scene::DynamicsOptions o;
  o.dt_s = b.dt_s;
  dynamics::Integrator dynamics(b.robot.chain, o), stopping(b.robot.chain, o);
  dynamics::State s = dynamics.start(b.q, b.qd);
  double nearest_m = 1;
  for (int k = 0; k < 2000; ++k) {
    b.q = s.q, b.qd = s.qd, b.t_s = k * b.dt_s;
    p.plan(b.input(), out);
    if (k % 20 == 0) {
      Planner braking(b.robot, b.options);
      Output stop = braking.output();
      dynamics::State t = stopping.start(s.q, s.qd);
      for (int i = 0; i < 100; ++i) {
        braking.plan({.q = t.q, .qd = t.qd, .obstacles = b.obstacles, .state_age_s = 1}, stop);
        ASSERT_TRUE(stopping.step(t, stop.torque_Nm).usable());
      }
      EXPECT_EQ(stop.report.contacts, 0u) << b.t_s;
      nearest_m = std::min(nearest_m, stop.report.clearance_min_m);
    }
    ASSERT_TRUE(dynamics.step(s, out.torque_Nm).usable());
  }
  EXPECT_LT(nearest_m, 0.1) << "the arm did come near";
}

TEST(States, AStateOfThirtyMillisecondsGoesOnToNow) {
  Bench b;
  b.qd = Eigen::Vector4d(0.3, -0.2, 0.5, 0.1);
  b.obstacles = {sphere(1, {1.9, 2.3, 0}, 0.2)};
  b.state_age_s = 0.03;
  const Output late = b.plan();
  b.q += 0.03 * b.qd;
  b.state_age_s = 0;
  const Output now = b.plan();
  EXPECT_NEAR((late.torque_Nm - now.torque_Nm).norm(), 0, 1e-2 * now.torque_Nm.norm());
  EXPECT_NEAR((late.report.end_effector_m - now.report.end_effector_m).norm(), 0, 1e-12);
}

TEST(States, OldObstaclesSlowThenStop) {
  Bench b;
  b.options.vmax_mps = 0.5;
  const double fresh = b.plan().torque_Nm.norm();
  b.obstacle_age_s = 0.2;
  const Output slow = b.plan();
  expect(slow, State::moving, Reason::none);
  EXPECT_NEAR(slow.torque_Nm.norm() / fresh, 0.5, 0.01);
  b.obstacle_age_s = 0.31;
  expect(b.plan(), State::unsafe, Reason::stale_obstacles);
}

TEST(States, WaitsForTheFirstObstaclesWhereSomeAreExpected) {
  Bench b;
  b.obstacles.clear();
  b.obstacle_age_s = scene::kInf;
  expect(b.plan(), State::moving, Reason::none);
  b.expected = true;
  const Output out = b.plan();
  expect(out, State::idle, Reason::stale_obstacles);
  EXPECT_TRUE(out.torque_Nm.isZero());
  b.obstacle_age_s = 0;  // an explicit empty set
  expect(b.plan(), State::moving, Reason::none);
}

TEST(States, NotFiniteIsUnsafe) {
  Bench b;
  b.obstacles[0].X_WO.p[1] = std::nan("");
  expect(b.plan(), State::unsafe, Reason::non_finite);
  b = Bench();
  b.q[2] = std::nan("");
  const Output out = b.plan();
  expect(out, State::unsafe, Reason::non_finite);
  EXPECT_TRUE(out.torque_Nm.isZero());
}

TEST(States, MisfitIsAFault) {
  Bench b;
  b.goal.kind = scene::GoalKind::joints;
  b.goal.joints = Eigen::VectorXd::Zero(3);
  expect(b.plan(), State::fault, Reason::configuration);
  b = Bench();
  b.dt_s = 0;
  expect(b.plan(), State::fault, Reason::configuration);
  b = Bench();
  b.q = Eigen::VectorXd::Zero(5);
  expect(b.plan(), State::fault, Reason::internal);
}

// A base that reaches farther than the arm does.
TEST(States, WhatRunsIntoTheBaseIsToldWhereverItIs) {
  Bench b;
  scene::LinkShape pedestal;
  pedestal.link = -1;
  pedestal.shape = {geometry::ShapeKind::sphere, {0.5, 0, 0}};
  pedestal.X_LS.p = {0, 0, -6};
  b.robot.shapes.push_back(pedestal);
  b.obstacles = {sphere(1, {0.6, 0, -6}, 0.2, {-0.1, 0, 0})};
  const Output out = b.plan();
  expect(out, State::unsafe, Reason::contact);
  EXPECT_NE(std::string(out.report.detail).find("base"), std::string::npos);
}

TEST(States, JointLimitIsNamed) {
  Bench b;
  b.robot = planar_arm(1, 1.0 / 12, 0.05);
  model::ChainSpec spec = b.robot.chain.spec();
  spec.joints[0].limits.upper = 2.6, spec.joints[0].limits.lower = -2.6;
  b.robot.chain = checked(spec);
  b.q = Eigen::VectorXd::Constant(1, 2.5);
  b.qd = Eigen::VectorXd::Zero(1);
  b.goal.X_WG.p = {std::cos(2.5), -std::sin(2.5), 0};  // the short way leads over the limit
  b.options.escapes = 0;
  b.obstacles.clear();
  const RunResult r = b.go(10);
  EXPECT_EQ(r.last.state, State::stuck);
  EXPECT_EQ(r.last.reason, Reason::joint_limit);
  EXPECT_LT(r.q[0], 2.6 + 1e-3);  // the barrier holds the limit
  EXPECT_GT(r.q[0], 2.5);
}

// The arm is drawn round without end.
TEST(States, AnOrbitIsNamed) {
  planner::Memory memory;
  const scene::PlannerOptions o;
  planner::start_goal(memory, 0);
  planner::Progress now;
  now.scaled_error = 50;
  now.speed = 1;
  planner::Verdict verdict;
  for (now.t_s = 0; now.t_s < 13; now.t_s += 0.01) {
    verdict = planner::judge(o, memory, now);
    memory.state = static_cast<std::uint64_t>(verdict.state);
    memory.reason = static_cast<std::uint64_t>(verdict.reason);
    ASSERT_EQ(verdict.state == State::stuck, now.t_s >= 4 * o.progress_window_s) << now.t_s;
  }
  EXPECT_EQ(verdict.reason, Reason::orbit);
  now.speed = 0;  // it comes to rest: what held it up stays said
  for (; now.t_s < 20; now.t_s += 0.01) verdict = planner::judge(o, memory, now);
  EXPECT_EQ(verdict.reason, Reason::orbit);
  now.target_blocked = true;
  EXPECT_EQ(planner::judge(o, memory, now).reason, Reason::goal_blocked);
  now.scaled_error = 40;
  EXPECT_EQ(planner::judge(o, memory, now).state, State::moving);
}

// Something flies at an arm whose joints are too weak to get out of its way in time.
TEST(States, WeakJointsAreNamed) {
  Bench b;
  model::ChainSpec spec = b.robot.chain.spec();
  for (model::Joint& j : spec.joints) j.limits.effort = 0.5;
  b.robot.chain = checked(spec);
  b.obstacles = {sphere(1, {2.0, 1.6, 0}, 0.2, {0, -1, 0})};
  b.obstacles[0].X_WO.p = b.plan(false).report.end_effector_m + Eigen::Vector3d(0, 0.3, 0);
  expect(b.plan(), State::unsafe, Reason::torque_limit);
}

TEST(States, RampBeginsWithAHold) {
  Bench b;
  Planner p(b.robot, b.options);
  p.set_goal(b.goal);
  p.ramp_in();
  Output out = p.output();
  const double full = b.plan().torque_Nm.norm();
  p.plan(b.input(), out);
  EXPECT_TRUE(out.torque_Nm.isZero());
  b.t_s = 0.1;
  p.plan(b.input(), out);
  EXPECT_NEAR(out.torque_Nm.norm() / full, 0.5, 1e-9);
  b.t_s = 0.3;
  p.plan(b.input(), out);
  EXPECT_NEAR(out.torque_Nm.norm() / full, 1, 1e-9);
}

}  // namespace
}  // namespace hamel::test
