// What the planner makes of obstacles: velocities that are not told, and what an approaching one may do to
// the arm.
#include <gtest/gtest.h>

#include "services/planner/core/pairs.h"
#include "tests/support/planner_scene.h"

namespace hamel::test {
namespace {

using planner::Memory;
using planner::Obstacles;

TEST(UnknownVelocity, IsEstimatedFromTwoSets) {
  scene::PlannerOptions o;
  o.assumed_acceleration_mps2 = 0;
  Memory memory;
  Obstacles obstacles;
  geometry::Obstacle ball = sphere(5, {1, 0, 0}, 0.1);
  ball.velocity_known = false;
  const Eigen::Vector3d v(0.5, -0.2, 0.1);
  obstacles.take({&ball, 1}, 0.05, 0.05, o, memory);  // stamped 0
  EXPECT_EQ(obstacles.velocities_unknown(), 1);
  EXPECT_NEAR(obstacles.items()[0].inflation_m, 0.05, 1e-15);  // grows, stays; 1 m/s by default
  EXPECT_TRUE(obstacles.items()[0].now.V_WO.isZero());
  ball.X_WO.p += v / 30;
  for (const double age : {0.02, 0.05}) {  // stamped 1/30, looked at twice
    obstacles.take({&ball, 1}, 1.0 / 30 + age, age, o, memory);
    const Obstacles::Item& item = obstacles.items()[0];
    EXPECT_EQ(obstacles.velocities_estimated(), 1);
    EXPECT_NEAR((item.now.V_WO.tail<3>() - v).norm(), 0, 1e-12);
    EXPECT_NEAR((item.now.X_WO.p - ball.X_WO.p - age * v).norm(), 0, 1e-12);
    EXPECT_EQ(item.inflation_m, 0);
  }
}

// Nobody knows how an obstacle went on since it was seen.
TEST(Obstacle, GrowsWithTheAgeOfItsSight) {
  scene::PlannerOptions o;
  o.assumed_acceleration_mps2 = 3;
  Memory memory;
  Obstacles obstacles;
  const geometry::Obstacle ball = sphere(5, {1, 0, 0}, 0.1, {1, 0, 0});
  obstacles.take({&ball, 1}, 0.2, 0.2, o, memory);
  EXPECT_NEAR(obstacles.items()[0].inflation_m, 0.06, 1e-15);
}

TEST(UnknownVelocity, JumpsAndGapsAreNoMotion) {
  scene::PlannerOptions o;
  Memory memory;
  Obstacles obstacles;
  geometry::Obstacle ball = sphere(5, {1, 0, 0}, 0.1);
  ball.velocity_known = false;
  obstacles.take({&ball, 1}, 0, 0, o, memory);
  ball.X_WO.p[0] += 1;  // 30 m/s
  obstacles.take({&ball, 1}, 1.0 / 30, 0, o, memory);
  EXPECT_EQ(obstacles.velocities_unknown(), 1);
  ball.X_WO.p[0] += 0.1;
  obstacles.take({&ball, 1}, 3, 0, o, memory);
  EXPECT_EQ(obstacles.velocities_unknown(), 1);
}

// The same sight again, told as older or younger because another source spoke, changes no speed.
TEST(UnknownVelocity, IsMadeOutFromTheTimesOfTheSightsAlone) {
  scene::PlannerOptions o;
  planner::Memory memory;
  planner::Obstacles obstacles;
  geometry::Obstacle ball = sphere(1, {1, 0, 0}, 0.1);
  ball.velocity_known = false;
  for (int k = 0; k < 4; ++k) {
    ball.seen_s = 0.1 * k;
    ball.X_WO.p.x() = 1 + 0.05 * k;
    for (const double age : {0.0, 0.02, 0.07}) obstacles.take({&ball, 1}, 0.1 * k + 0.08, age, o, memory);
  }
  ASSERT_EQ(obstacles.items().size(), 1u);
  EXPECT_EQ(obstacles.velocities_estimated(), 1);
  EXPECT_NEAR(obstacles.items()[0].now.V_WO[3], 0.5, 1e-12);
}

// A sphere that flies at the first link, which hardly any joint can move out of its way, must not throw the
// other links about: the operational inertia of such a point is nearly singular.  Weighed by all of it the
// obstacle's own velocity would ask for 2,300 to 26,500 rad/s^2 here.
TEST(MovingObstacle, AtTheShoulderDoesNotThrowTheArmAbout) {
  const scene::Robot robot = planar_arm(4, 1.0 / 12, 0.05);
  scene::PlannerOptions o;
  o.barrier_gain = 0;
  o.kc = 0;
  o.rho0_m = 0.4;
  planner::Planner planner(robot, o);
  planner::Output out = planner.output();
  const Eigen::VectorXd q = Eigen::Vector4d(0, 0.5, 0.5, 0.5), qd = Eigen::VectorXd::Zero(4);
  for (const double x : {0.05, 0.2, 0.5, 0.9}) {
    const std::vector<geometry::Obstacle> balls{sphere(1, {x, 0.4, 0}, 0.2, {0.5, -1, 0})};
    planner.plan({.q = q, .qd = qd, .obstacles = balls}, out);
    rbd::Workspace ws(robot.chain);
    Eigen::VectorXd qdd(4);
    rbd::forward_dynamics(robot.chain, q, qd, out.torque_Nm, ws, qdd);
    EXPECT_LT(qdd.lpNorm<Eigen::Infinity>(), 300) << x;
  }
}

TEST(MovingObstacle, GoesOnAheadOfACycleAsItDoesWithAge) {
  const scene::Robot robot = planar_arm(1, 1.0 / 12, 0.05);
  scene::PlannerOptions o;
  o.rho0_m = 1;
  o.assumed_acceleration_mps2 = 0;
  planner::Arm arm(robot.chain);
  arm.update(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1));
  geometry::Obstacle rod = sphere(1, {0.5, 0.8, 0}, 0, {0.1, -0.2, 0});
  rod.shape = {geometry::ShapeKind::capsule, {0.05, 1, 0}};
  rod.X_WO.R << 0, 0, 1, 0, 1, 0, -1, 0, 0;  // along x
  rod.V_WO[2] = 1;
  Memory memory;
  Obstacles now, later;
  now.take({&rod, 1}, 0, 0, o, memory);
  later.take({&rod, 1}, 0.3, 0.3, o, memory);
  planner::Pairs ahead(robot, o), aged(robot, o);
  ahead.find(arm, now);
  aged.find(arm, later);
  ASSERT_EQ(ahead.items().size(), 1u);
  ASSERT_EQ(aged.items().size(), 1u);
  const double before_m = ahead.items()[0].d;
  ahead.advance(arm, 0.3);
  EXPECT_NEAR(ahead.items()[0].d, aged.items()[0].d, 1e-12);
  EXPECT_LT(ahead.items()[0].d, before_m - 0.06 - 0.1) << "it goes and it turns";
}

// Whatever the state: the command with the compensation of gravity stays within the joints' strength.
TEST(TorqueLimits, HoldForTheSumWithGravity) {
  Random rng(4);
  for (int k = 0; k < 200; ++k) {
    model::ChainSpec spec = random_spec(rng, 6);
    for (model::Joint& j : spec.joints) j.limits.effort = rng.uniform(20, 200);
    scene::Robot robot{"r", "", checked(std::move(spec)), {}};
    scene::PlannerOptions o;
    planner::Planner planner(robot, o);
    planner::Output out = planner.output();
    scene::Goal goal;
    goal.id = 1;
    goal.X_WG.p = rng.vec3(1);
    planner.set_goal(goal);
    const Eigen::VectorXd q = rng.vector(6, 1), qd = rng.vector(6, 0.2);
    rbd::Workspace ws(robot.chain);
    rbd::positions(robot.chain, q + 0.5e-3 * qd, ws);
    Eigen::VectorXd gravity(6);
    rbd::gravity_torque(robot.chain, ws, gravity);
    bool strong = true;  // strong enough to stand at all
    for (int j = 0; j < 6; ++j) strong &= std::abs(gravity[j]) < 0.9 * robot.chain.joint(j).limits.effort;
    if (!strong) continue;
    planner.plan({.q = q, .qd = qd, .obstacles = {}}, out);
    for (int j = 0; j < 6; ++j) {
      const double limit = robot.chain.joint(j).limits.effort;
      EXPECT_LE(std::abs(out.torque_Nm[j] + gravity[j]), limit + 0.05) << k;
    }
  }
}

}  // namespace
}  // namespace hamel::test
