// Goals: met, refused or approached; links that must not touch; obstacles out of reach.
#include <gtest/gtest.h>

#include "common/rbd/rbd.h"
#include "common/scene/self_links.h"
#include "services/planner/core/pairs.h"
#include "services/planner/core/reachable.h"
#include "tests/support/planner_scene.h"
#include "tests/support/soak.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

scene::PlannerOptions planar_options() {
  scene::PlannerOptions o;
  o.vmax_mps = 1;
  return o;
}

model::Chain seven_joints(test::Random& rng) {
  model::ChainSpec spec = test::random_chain(rng, 7).spec();
  for (model::Joint& j : spec.joints) j.limits.lower = -2.5, j.limits.upper = 2.5;
  return model::build(std::move(spec)).value();
}

TEST(Reach, RefusesNoGoalThatAConfigurationMeets) {
  test::Random rng(5);
  int refused = 0;
  for (int k = 0; k < 2000; ++k) {
    const model::Chain chain = seven_joints(rng);
    rbd::Workspace ws(chain);
    rbd::positions(chain, rng.vector(7, 2.5), ws);
    scene::Goal goal;
    goal.kind = k % 2 ? scene::GoalKind::pose : scene::GoalKind::position;
    goal.X_WG = rbd::tip(chain, ws);
    refused += !reachability(chain, {goal}, {}).reachable;
  }
  EXPECT_EQ(refused, 0);
}

TEST(Reach, KnowsAnglesBeyondHalfATurn) {
  test::Random rng(6);
  int refused = 0;
  for (int k = 0; k < 200; ++k) {
    model::ChainSpec spec = test::random_chain(rng, 7).spec();
    for (model::Joint& j : spec.joints) j.limits.lower = -0.02, j.limits.upper = 3.8;
    spec.joints[0].limits.lower = 3.3;
    const model::Chain chain = model::build(std::move(spec)).value();
    const VectorXd q = VectorXd::Constant(7, 3.5) + rng.vector(7, 0.2);
    rbd::Workspace ws(chain);
    rbd::positions(chain, q, ws);
    scene::Goal goal;
    goal.kind = scene::GoalKind::pose;
    goal.X_WG = rbd::tip(chain, ws);
    refused += !reachability(chain, {goal}, {}).reachable;
  }
  EXPECT_EQ(refused, 0);
}

TEST(Reach, RefusesWhatIsBeyondTheArmAndKnowsTheNearestPlace) {
  const scene::Robot robot = test::planar_arm(4, 0.1, 0.05);
  for (double angle = 0; angle < 6; angle += 0.5) {
    scene::Goal goal;
    const Vector3d along(std::cos(angle), std::sin(angle), 0);
    goal.X_WG.p = 5 * along;
    const Reachability found = reachability(robot.chain, {goal}, {});
    EXPECT_FALSE(found.reachable);
    EXPECT_NEAR((found.nearest_W - 4 * along).norm(), 0, 1e-2) << angle;
    goal.X_WG.p = 3.9 * along;
    EXPECT_TRUE(reachability(robot.chain, {goal}, {}).reachable) << angle;
  }
}

// A pose leaves the last link no choice; a position leaves it every turn.
TEST(Blocked, ByWhatTheLastLinkCannotTake) {
  const scene::Robot robot = test::planar_arm(2, 0.1, 0.05);  // its last link: 1 m behind the end effector
  const scene::PlannerOptions options;
  const Pairs pairs(robot, options);
  Obstacles::Item beside;
  beside.now = test::sphere(1, {-0.5, 0, 0}, 0.1);
  beside.solid = geometry::solid(beside.now.shape, beside.now.X_WO);
  lie::Pose X_WT;
  EXPECT_TRUE(pairs.blocks(beside, X_WT, false, 0.01));
  EXPECT_FALSE(pairs.blocks(beside, X_WT, true, 0.01));
  X_WT.R = Eigen::AngleAxisd(0.5 * M_PI, Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_FALSE(pairs.blocks(beside, X_WT, false, 0.01));
  Obstacles::Item upon;
  upon.now = test::sphere(2, {0.14, 0, 0}, 0.1);  // within the radius of the link's end
  upon.solid = geometry::solid(upon.now.shape, upon.now.X_WO);
  EXPECT_TRUE(pairs.blocks(upon, X_WT, true, 0.01));
}

test::RunResult run_to(const scene::PlannerOptions& o, const Vector3d& target) {
  scene::Goal goal;
  goal.id = 1;
  goal.X_WG.p = target;
  return test::run(test::planar_arm(4, 0.1, 0.05), {}, o, goal, Eigen::Vector4d(0.4, 0.8, 0.8, 0.8), 2e-3,
                   12);
}

TEST(Goals, OutOfReachIsRefusedAtOnceWithoutMotion) {
  const test::RunResult r = run_to(planar_options(), {3, 4, 0});
  EXPECT_EQ(r.last.state, State::stuck);
  EXPECT_EQ(r.last.reason, Reason::unreachable);
  EXPECT_LE(r.stuck_at_s, 0.01);
  EXPECT_LT(r.last.path_length_m, 1e-9);
}

TEST(Goals, OutOfReachIsApproachedWhenAsked) {
  scene::PlannerOptions o = planar_options();
  o.unreachable = scene::Unreachable::approach;
  const test::RunResult r = run_to(o, {3, 4, 0});
  EXPECT_EQ(r.last.state, State::stuck);
  EXPECT_EQ(r.last.reason, Reason::unreachable);
  EXPECT_EQ(r.reached_at_s, -1);
  EXPECT_NEAR(r.last.target_error_m, 1, 0.02);
  EXPECT_NEAR((r.last.end_effector_m - Vector3d(2.4, 3.2, 0)).norm(), 0, 0.02);
}

TEST(Goals, JointsBeyondTheirLimitsAreRefusedOrApproached) {
  scene::Robot robot = test::planar_arm(2, 0.1, 0.05);
  model::ChainSpec spec = robot.chain.spec();
  for (model::Joint& j : spec.joints) j.limits.lower = -1, j.limits.upper = 1;
  robot.chain = test::checked(spec);
  scene::Goal goal;
  goal.id = 1;
  goal.kind = scene::GoalKind::joints;
  goal.joints = Eigen::Vector2d(0.5, 1.5);
  scene::PlannerOptions o = planar_options();
  for (const auto wish : {scene::Unreachable::reject, scene::Unreachable::approach}) {
    o.unreachable = wish;
    const bool approach = wish == scene::Unreachable::approach;
    const test::RunResult r = test::run(robot, {}, o, goal, Eigen::Vector2d(0, 0), 2e-3, 10);
    EXPECT_EQ(r.last.state, State::stuck);
    EXPECT_EQ(r.last.reason, Reason::unreachable);
    EXPECT_EQ(r.reached_at_s, -1);
    EXPECT_NEAR((r.q - Eigen::Vector2d(0.5, 1)).norm(), 0, approach ? 0.02 : 2);
    EXPECT_NEAR(r.last.target_error_m, approach ? 0.5 : 1.5, 0.02);
    EXPECT_EQ(r.q.isZero(0), !approach);
  }
}

// What stands in the way leads an arm about that has no goal to reach: it ends all the same, as near as it
// came.
TEST(Goals, ApproachEndsAmongObstacles) {
  test::Random rng(17);
  scene::PlannerOptions o = planar_options();
  o.unreachable = scene::Unreachable::approach;
  for (int k = 0; k < (test::kSanitized ? 3 : 10); ++k) {
    std::vector<geometry::Obstacle> seen;
    for (std::uint32_t i = 1; i <= 4; ++i)
      seen.push_back(test::sphere(i, {rng.uniform(1, 4), rng.uniform(1, 4), 0}, 0.2));
    scene::Goal goal;
    goal.id = 1;
    goal.X_WG.p = Vector3d(3, 4, 0);
    double least = scene::kInf;
    const test::RunResult r =
        test::run(test::planar_arm(4, 0.1, 0.05), seen, o, goal, Eigen::Vector4d(-0.4, -0.8, 0.8, 0.8), 2e-3,
                  30, [&](const test::RunResult& now) {
                    least = std::min(least, now.last.target_error_m);
                    return false;
                  });
    EXPECT_EQ(r.last.state, State::stuck) << k;
    EXPECT_EQ(r.contact_at_s, -1) << k;
    EXPECT_LT(r.last.target_error_m, least + 0.3) << k << ", once as near as " << least;
  }
}

TEST(Goals, AMovingTargetIsFollowed) {
  scene::Goal goal;
  goal.id = 1;
  goal.X_WG.p = {2, 1, 0};
  goal.V_WG.tail<3>() = Vector3d(0.02, 0.03, 0);
  const test::RunResult r = test::run(test::planar_arm(4, 0.1, 0.05), {}, planar_options(), goal,
                                      Eigen::Vector4d(0.4, 0.8, 0.8, 0.8), 2e-3, 15);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_LT(r.last.target_error_m, 0.005);
  EXPECT_NEAR((r.last.end_effector_m - Vector3d(2.3, 1.45, 0)).norm(), 0, 0.01);
}

/// Three links of which the third shall go through the first.
test::RunResult fold(scene::Method method) {
  scene::Robot robot = test::planar_arm(3, 0.1, 0.05);
  scene::watch(robot, {{0, 2}});
  scene::PlannerOptions o = planar_options();
  o.method = method;
  scene::Goal goal;
  goal.id = 1;
  goal.kind = scene::GoalKind::joints;
  goal.joints = Eigen::Vector3d(0, 2.8, 2.8);
  return test::run(robot, {}, o, goal, Eigen::Vector3d(0, 1, 0.3), 2e-3, 12);
}

TEST(SelfCollision, BarrierKeepsLinksApart) {
  const test::RunResult r = fold(scene::Method::gyro);
  EXPECT_EQ(r.contact_at_s, -1);
  EXPECT_EQ(r.last.state, State::stuck);
  EXPECT_GT(r.final_error_m, 0.1);
}

TEST(SelfCollision, IsReportedUnsafeWhereNothingPreventsIt) {
  const test::RunResult r = fold(scene::Method::attract);
  EXPECT_GT(r.contact_at_s, 0);
  EXPECT_EQ(r.last.state, State::unsafe);
  EXPECT_EQ(r.last.reason, Reason::contact);
  EXPECT_STREQ(r.last.detail, "two links touch");
}

TEST(SelfLinks, LeavesOutNeighboursAllowedOnesAndThoseThatAlwaysTouch) {
  scene::Robot robot = test::planar_arm(4, 0.1, 0.05);
  EXPECT_EQ(scene::self_links(robot).watched, (std::vector<std::pair<int, int>>{{0, 2}, {0, 3}, {1, 3}}));
  EXPECT_EQ(scene::self_links(robot, {{0, 3}}).watched, (std::vector<std::pair<int, int>>{{0, 2}, {1, 3}}));
  robot.shapes[0].shape.dims_m[0] = 3;  // swallows links 1 and 2
  const scene::SelfLinks found = scene::self_links(robot);
  EXPECT_EQ(std::count(found.touching.begin(), found.touching.end(), std::pair{0, 2}), 1);
}

TEST(Obstacles, OutOfReachChangeNothing) {
  const scene::Robot robot = test::planar_arm(4, 0.1, 0.05);
  std::vector<geometry::Obstacle> near, all;
  test::Random rng(9);
  for (std::uint32_t k = 0; k < 10; ++k) near.push_back(test::sphere(k, rng.vec3(3), 0.1));
  all = near;
  for (std::uint32_t k = 10; k < 1000; ++k)
    all.push_back(test::sphere(k, Vector3d(10, 0, 0) + rng.vec3(4), 0.1));
  Planner a(robot, planar_options()), b(robot, planar_options());
  scene::Goal goal;
  goal.id = 1;
  goal.X_WG.p = {1, 2, 0};
  a.set_goal(goal);
  b.set_goal(goal);
  Output x = a.output(), y = b.output();
  for (int k = 0; k < 20; ++k) {
    const VectorXd q = rng.vector(4, 1), qd = rng.vector(4, 1);
    const double t = 1e-3 * k;
    a.plan({.step = 1, .t_s = t, .q = q, .qd = qd, .obstacles = near}, x);
    b.plan({.step = 1, .t_s = t, .q = q, .qd = qd, .obstacles = all, .obstacle_set = k < 10 ? 0u : 7u}, y);
    EXPECT_EQ(x.torque_Nm, y.torque_Nm) << k;
    EXPECT_EQ(x.report.clearance_m, y.report.clearance_m);
  }
}

}  // namespace
}  // namespace hamel::planner
