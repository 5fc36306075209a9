// The barrier's parts: the shortest vector under inequalities, and the second derivative of a distance.
#include <gtest/gtest.h>

#include "common/rbd/rbd.h"
#include "services/planner/core/barrier.h"
#include "services/planner/core/least_norm.h"
#include "tests/support/planner_scene.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

Eigen::MatrixXd random_rows(test::Random& rng, int n, int rows) {
  Eigen::MatrixXd C(n, rows);
  for (int i = 0; i < rows; ++i) C.col(i) = rng.vector(n, 1).normalized();
  return C;
}

// Karush, Kuhn, Tucker: x = C u, u >= 0, C^T x + give u >= s with equality where u > 0 decide the solution.
TEST(LeastNorm, MeetsTheConditionsOfAMinimum) {
  test::Random rng(1);
  for (int k = 0; k < 20000; ++k) {
    const int n = 1 + k % 7, rows = 1 + static_cast<int>(rng.uniform(0, 15));
    Eigen::MatrixXd C = random_rows(rng, n, rows);
    if (rng.coin(0.3) && rows > 1) C.col(rows - 1) = C.col(0);   // twins
    if (rng.coin(0.3) && rows > 2) C.col(rows - 2) = -C.col(0);  // a contradiction
    const VectorXd s = rng.vector(rows, 1).array() - 0.4;
    VectorXd give(rows);
    for (double& g : give) g = std::pow(10, rng.uniform(-7, 0));
    LeastNorm solver(n, rows);
    ASSERT_TRUE(solver.solve(C, s, give, rows)) << k;
    const VectorXd &x = solver.x(), &u = solver.multipliers();
    const VectorXd slack = C.transpose() * x + give.cwiseProduct(u) - s;
    ASSERT_LE((x - C * u).norm(), 1e-9 * (1 + u.norm())) << k;
    ASSERT_GE(u.minCoeff(), 0) << k;
    ASSERT_GE(slack.minCoeff(), -1e-7) << k;
    ASSERT_LE(u.cwiseProduct(slack).lpNorm<Eigen::Infinity>(), 1e-7 * (1 + u.norm())) << k;
  }
}

TEST(LeastNorm, ContradictionsShareTheMissByTheirPrice) {
  Eigen::MatrixXd C(2, 2);
  C << 1, -1, 0, 0;
  const Eigen::Vector2d give(1e-4, 3e-4);
  LeastNorm solver(2, 2);
  ASSERT_TRUE(solver.solve(C, Eigen::Vector2d(1, -0.2), give, 2));  // x >= 1 and x <= 0.2
  EXPECT_NEAR(solver.x()[0], 0.8, 1e-3);
  ASSERT_TRUE(solver.solve(C, Eigen::Vector2d(1, -1), give, 2));
  EXPECT_NEAR(solver.x()[0], 1, 2e-4);
  ASSERT_TRUE(solver.solve(C, Eigen::Vector2d(-1, -1), give, 2));
  EXPECT_TRUE(solver.x().isZero(0));
}

// hdd from a chain's own motion: Jacobian, bias and curvature against differences of the distance in time,
// with every joint velocity constant (qdd = 0) and the obstacle flying and turning.
/// What the link is, and what it passes.
struct Passing {
  geometry::Shape link, obstacle;
};
class ForObstacle : public testing::TestWithParam<Passing> {};

TEST_P(ForObstacle, SecondDerivativeOfTheDistanceAgreesWithDifferences) {
  test::Random rng(2);
  int compared = 0;
  for (int k = 0; k < 400; ++k) {
    scene::Robot robot{"r", "", test::random_chain(rng, 4), {}};
    robot.shapes.push_back({3, GetParam().link, rng.pose(0.4)});
    scene::PlannerOptions options;
    options.rho0_m = 1e3;
    Arm arm(robot.chain);
    Obstacles obstacles;
    Memory memory;
    Pairs pairs(robot, options);
    const VectorXd q = rng.vector(4, 3), qd = rng.vector(4, 1);
    geometry::Obstacle o;
    o.shape = GetParam().obstacle;
    o.X_WO = rng.pose(1);
    o.V_WO << rng.vec3(1), rng.vec3(1);
    const auto distance = [&](double t) {
      arm.update(q + t * qd, qd);
      geometry::Obstacle moved = o;
      moved.X_WO.p += t * o.V_WO.tail<3>();
      const Vector3d turn = t * o.V_WO.head<3>();
      moved.X_WO.R = Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix() * o.X_WO.R;
      obstacles.take({&moved, 1}, 0, 0, options, memory);
      pairs.find(arm, obstacles);
      return pairs.items()[0].at;
    };
    const double h = 1e-4;
    const geometry::Closest before = distance(-h), after = distance(h), now = distance(0);
    const bool same_feature = before.slides_on_link == after.slides_on_link && now.distance_m > 0.05 &&
                              before.obstacle_axis.isZero() == after.obstacle_axis.isZero() &&
                              before.link_axis2.isZero() == after.link_axis2.isZero() &&
                              before.link_axis.isZero() == after.link_axis.isZero() &&
                              std::isfinite(before.centre_m) == std::isfinite(after.centre_m);
    if (!same_feature) continue;
    pairs.complete(arm);
    const Pair& pair = pairs.items()[0];
    const Vector3d bias = rbd::point_bias_acceleration(arm.chain, arm.ws, 3, now.on_axis, arm.qd);
    const double rate = -pair.n.dot(pair.v_relative);
    const double second = -pair.n.dot(bias) + distance_curvature(pair, arm.angular_velocity(3), 1e-3);
    EXPECT_NEAR(rate, (after.distance_m - before.distance_m) / (2 * h), 1e-5) << k;
    const double measured = (after.distance_m - 2 * now.distance_m + before.distance_m) / (h * h);
    // an obstacle that turns accelerates its own points; the planner leaves that out
    const bool flat = !std::isfinite(now.centre_m);
    const double apart_m = flat ? (now.on_obstacle - now.on_axis).norm() : now.centre_m;
    const Vector3d arm_o = now.on_axis + apart_m * now.normal - o.X_WO.p;
    const Vector3d omega = o.V_WO.head<3>();
    const double said = second + pair.n.dot(omega.cross(omega.cross(arm_o)));
    const double most = 2e-3 * (1 + std::abs(measured));
    // The rim of a cylinder counts as a line or a corner: it curves away, so that less comes out, never more.
    if (GetParam().obstacle.kind == geometry::ShapeKind::cylinder)
      EXPECT_LE(said, measured + most) << k;
    else
      EXPECT_NEAR(said, measured, most) << k;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

// A link that slides along an edge it is nearly parallel to: the exact second derivative grows without bound.
TEST(DistanceCurvature, StaysBoundedBetweenNearlyParallelLines) {
  const Vector3d ahead(1, 0, 0);
  Obstacles::Item item;
  item.now.shape = {geometry::ShapeKind::capsule, {0.02, 0.7, 0}};
  for (double angle = 0.3; angle > 1e-9; angle *= 0.3) {
    item.now.X_WO.R = Eigen::AngleAxisd(0.5 * M_PI, Vector3d::UnitY()).toRotationMatrix();
    item.solid = geometry::solid(item.now.shape, item.now.X_WO);
    geometry::Capsule link;
    const Vector3d along(std::cos(angle), std::sin(angle), 0);
    link.p0 = Vector3d(0, 0, 0.2) - 0.2 * along;
    link.p1 = Vector3d(0, 0, 0.2) + 0.2 * along;
    link.radius_m = 0.05;
    Pair pair;
    pair.item = &item;
    pair.at = geometry::closest(link, item.now.shape, item.now.X_WO);
    pair.n = pair.at.normal;
    pair.span_m = 0.5;
    const Vector3d omega(0.5, 1, 0);
    pair.v = ahead + omega.cross(pair.at.on_link - pair.at.on_axis);
    const double curvature = distance_curvature(pair, omega, 1.0 / 30);
    EXPECT_TRUE(std::isfinite(curvature)) << angle;
    EXPECT_GT(curvature, -200) << angle;
  }
}

// Whatever stands in the way and whatever was wanted.
TEST(Barrier, AsksForNoAccelerationBeyondItsBound) {
  test::Random rng(4);
  constexpr double kMost = 10;
  int given_up = 0;
  for (int k = 0; k < 2000; ++k) {
    model::ChainSpec spec = test::random_chain(rng, 4).spec();
    for (model::Joint& j : spec.joints) {
      j.limits.lower = -2, j.limits.upper = 2;
      j.limits.velocity = 2, j.limits.acceleration = kMost;
    }
    scene::Robot robot{"r", "", model::build(std::move(spec)).value(), {}};
    for (int i = 0; i < 4; ++i) robot.shapes.push_back(test::link_capsule(i, {0, 0, 0}, {0.3, 0, 0}, 0.05));
    const scene::PlannerOptions options;
    Arm arm(robot.chain);
    arm.update(rng.vector(4, 2), rng.vector(4, 4));
    std::vector<geometry::Obstacle> seen;
    for (std::uint32_t i = 1; i <= 5; ++i) seen.push_back(test::sphere(i, rng.vec3(1), 0.2, rng.vec3(2)));
    Obstacles obstacles;
    Memory memory;
    obstacles.take(seen, 0, 0, options, memory);
    Pairs pairs(robot, options);
    pairs.find(arm, obstacles);
    pairs.complete(arm);
    Barrier barrier(arm, options);
    VectorXd a = rng.vector(4, 1e4);
    given_up += barrier.solve(arm, pairs, 1e-3, a).infeasible;
    ASSERT_LE(a.lpNorm<Eigen::Infinity>(), Barrier::kMostOver * kMost) << k;
  }
  EXPECT_GT(given_up, 0);
}

using geometry::ShapeKind;
constexpr double kRadius = 0.1;
INSTANTIATE_TEST_SUITE_P(
    Obstacles, ForObstacle,
    testing::Values(Passing{{ShapeKind::capsule, {0.05, 0.6, 0}}, {ShapeKind::sphere, {kRadius, 0, 0}}},
                    Passing{{ShapeKind::capsule, {0.05, 0.6, 0}}, {ShapeKind::capsule, {kRadius, 0.8, 0}}},
                    Passing{{ShapeKind::box, {0.3, 0.4, 0.6}}, {ShapeKind::sphere, {kRadius, 0, 0}}},
                    Passing{{ShapeKind::box, {0.3, 0.4, 0.6}}, {ShapeKind::capsule, {kRadius, 0.8, 0}}},
                    Passing{{ShapeKind::capsule, {0.05, 0.6, 0}}, {ShapeKind::half_space, {0, 0, 0}}},
                    Passing{{ShapeKind::box, {0.3, 0.4, 0.6}}, {ShapeKind::box, {0.2, 0.5, 0.3}}},
                    Passing{{ShapeKind::capsule, {0.05, 0.6, 0}}, {ShapeKind::cylinder, {kRadius, 0.8, 0}}}));

}  // namespace
}  // namespace hamel::planner
