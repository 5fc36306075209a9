// Links and obstacles as fewer and simpler solids: distances are at most the true ones, and at least those
// less the bound.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "common/scene/cadence.h"
#include "common/scene/outward.h"
#include "common/scene/reduce.h"
#include "tests/support/reduce_scene.h"

namespace hamel::scene {
namespace {

using geometry::Solid;

double nearest(const std::vector<Solid>& a, const std::vector<Solid>& b) {
  double d = kInf;
  for (const Solid& x : a)
    for (const Solid& y : b) d = std::min(d, geometry::closest(x, y).distance_m);
  return d;
}

std::vector<Solid> solids(const std::vector<geometry::Obstacle>& set) {
  std::vector<Solid> out;
  for (const geometry::Obstacle& o : set) out.push_back(geometry::solid(o.shape, o.X_WO));
  return out;
}

std::vector<Solid> solids(const Robot& robot, int link) {
  std::vector<Solid> out;
  for (const LinkShape& s : robot.shapes)
    if (s.link == link) out.push_back(geometry::solid(s.shape, s.X_LS));
  return out;
}

/// Bounds against errors found.
struct Tally {
  std::vector<double> ratios;
  int half_broken = 0, cases = 0;
  void add(double bound, double error) {
    ++cases;
    EXPECT_GE(error, -1e-9) << "not outward";
    EXPECT_LE(error, bound + 1e-9);
    if (bound > 0) ratios.push_back(bound / std::max(error, 1e-12));
    half_broken += error > 0.5 * bound + 1e-9;
  }
  void judge() {
    ASSERT_GE(ratios.size(), 1000u);
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    EXPECT_LT(*middle, 10);
    EXPECT_GT(half_broken, 0) << "half the bound is no bound";
  }
};

/// A link of a box, a cylinder and a tree of spheres.
void clothe(Robot& robot, int link, test::Random& rng) {
  const Eigen::Vector3d from = rng.vec3(0.1), along = rng.unit() * rng.uniform(0.01, 0.05);
  const double radius = rng.uniform(0.03, 0.08);
  const int spheres = 3 + static_cast<int>(rng.uniform(0, 5));
  for (int k = 0; k < spheres; ++k)
    robot.shapes.push_back({link,
                            {geometry::ShapeKind::sphere, {radius, 0, 0}},
                            {Eigen::Matrix3d::Identity(), from + k * along}});
  for (const auto kind : {geometry::ShapeKind::box, geometry::ShapeKind::cylinder})
    if (rng.coin(0.5)) {
      const Eigen::Vector3d d(rng.uniform(0.01, 0.1), rng.uniform(0.01, 0.1), rng.uniform(0.01, 0.1));
      robot.shapes.push_back({link, {kind, d}, rng.pose(0.1)});
    }
}

/// The largest difference of distances to points all round; those that touch say nothing.
double worst_difference(const std::vector<Solid>& before, const std::vector<Solid>& after, test::Random& rng,
                        double far) {
  double worst = 0;
  for (int i = 0; i < 60; ++i) {
    const auto probe = geometry::solid({geometry::ShapeKind::sphere, {1e-3, 0, 0}},
                                       {Eigen::Matrix3d::Identity(), before.front().X.p + rng.vec3(far)});
    const double d = nearest({probe}, before), now = nearest({probe}, after);
    if (now <= 0) continue;
    EXPECT_LE(now, d + 1e-9);
    worst = std::max(worst, d - now);
  }
  return worst;
}

TEST(Shapes, OfLinksGrowNoFartherThanTheBound) {
  test::Random rng(51);
  Tally tally;
  int fewer = 0;
  for (int k = 0; tally.ratios.size() < 1000 && k < 4000; ++k) {
    Scene s = test::random_scene(rng, false, 0);
    s.robot.shapes.clear();
    clothe(s.robot, 0, rng);
    Robot simpler = s.robot;
    const double most = std::pow(10, rng.uniform(-3, -1.5)), bound = simplify_shapes(simpler, most);
    EXPECT_LE(bound, most);
    fewer += simpler.shapes.size() < s.robot.shapes.size();
    if (bound == 0) continue;
    tally.add(bound, worst_difference(solids(s.robot, 0), solids(simpler, 0), rng, 0.25));
  }
  tally.judge();
  EXPECT_GT(fewer, 500);
}

TEST(Shapes, KeepWhichPairsAreWatched) {
  test::Random rng(53);
  Scene s = test::random_scene(rng, false, 0);
  Robot& robot = s.robot;
  robot.shapes.clear();
  const auto ball = [&](int link, double z) {
    robot.shapes.push_back(
        {link, {geometry::ShapeKind::sphere, {0.1, 0, 0}}, {Eigen::Matrix3d::Identity(), {0, 0, z}}});
  };
  ball(0, 0), ball(1, 0), ball(0, 0.01), ball(1, 0.01), ball(1, 5);
  robot.self_pairs = {{0, 1}, {0, 3}, {0, 4}, {2, 1}, {2, 3}, {2, 4}};
  EXPECT_GT(simplify_shapes(robot, 1e-2), 0);
  ASSERT_EQ(robot.shapes.size(), 3u);
  const std::vector<std::pair<std::size_t, std::size_t>> expected{{0, 1}, {0, 2}};
  EXPECT_EQ(robot.self_pairs, expected);
}

/// A locked joint makes one link of two: what only one of them was watched against stays so.
TEST(Shapes, OfTwoLinksThatALockedJointJoinedStayApart) {
  test::Random rng(59);
  Scene s = test::random_scene(rng, false, 0);
  Robot& robot = s.robot;
  robot.shapes.clear();
  for (const auto& [link, z] : {std::pair{0, 0.0}, {0, 0.01}, {1, 0.1}, {0, 0.011}})
    robot.shapes.push_back(
        {link, {geometry::ShapeKind::sphere, {0.1, 0, 0}}, {Eigen::Matrix3d::Identity(), {0, 0, z}}});
  robot.self_pairs = {{0, 2}};  // 1 and 3 touch their neighbour 2 by design
  EXPECT_GT(simplify_shapes(robot, 1e-2), 0);
  ASSERT_EQ(robot.shapes.size(), 3u);
  const std::vector<std::pair<std::size_t, std::size_t>> expected{{0, 2}};
  EXPECT_EQ(robot.self_pairs, expected);
}

/// Clouds of spheres: near the arm within most_m, farther off in proportion.
TEST(MergedObstacles, GrowNoFartherThanTheBound) {
  test::Random rng(57);
  Tally tally;
  std::size_t before = 0, after = 0;
  for (int k = 0; tally.ratios.size() < 1000 && k < 4000; ++k) {
    const Scene s = test::random_scene(rng, false, 0);
    const Reach reach(s.robot, s.planner);
    const double most = std::pow(10, rng.uniform(-3, -2));
    std::vector<geometry::Obstacle> all;
    const Eigen::Vector3d from = s.robot.chain.X_WB0().p + rng.vec3(4),
                          along = rng.unit() * rng.uniform(0.005, 0.04);
    const double radius = rng.uniform(0.03, 0.1);
    for (std::uint32_t id = 1; id <= 12; ++id) {
      all.push_back(test::sphere(
          id, from + id * along + (id % 3 == 0 ? rng.vec3(0.05) : Eigen::Vector3d::Zero()), radius));
      if (id % 5 == 0) all.back().V_WO[4] = 0.1;
    }
    std::vector<geometry::Obstacle> merged = all;
    Merge merge(most, s.planner.rho0_m);
    merge.apply(reach, 0, merged);
    before += all.size(), after += merged.size();
    double room = most;
    for (const geometry::Obstacle& o : all)
      room = std::max(room, most * reach.least_distance_m(o, 0) / s.planner.rho0_m);
    EXPECT_LE(merge.excess_m(), room);
    if (merge.excess_m() > 0)
      tally.add(merge.excess_m(), worst_difference(solids(all), solids(merged), rng, 0.5));
    for (const geometry::Obstacle& o : merged)
      EXPECT_TRUE(std::any_of(all.begin(), all.end(),
                              [&](const auto& a) { return a.id == o.id && a.V_WO == o.V_WO; }));
  }
  tally.judge();
  EXPECT_LT(after, before / 2);
}

TEST(MergedObstacles, OfUnknownOrTurningWayStayAsTheyAre) {
  test::Random rng(59);
  const Scene s = test::random_scene(rng, false, 0);
  std::vector<geometry::Obstacle> set;
  for (std::uint32_t id = 1; id <= 4; ++id) set.push_back(test::sphere(id, {1, 0, 0}, 0.1));
  set[0].velocity_known = false;
  set[1].V_WO[0] = 1;
  set[2].sigma_m = 0.01;
  Merge merge(1e-2, s.planner.rho0_m);
  merge.apply(Reach(s.robot, s.planner), 0, set);
  EXPECT_EQ(set.size(), 4u);
  EXPECT_EQ(merge.excess_m(), 0);
}

/// Nothing closes in by more than the bound between two cycles, at twice the speed the arm is drawn with.
TEST(Cycle, IsAsLongAsTheSpeedsAllow) {
  test::Random rng(61);
  int longer = 0;
  for (int k = 0; k < 1000; ++k) {
    Scene s = test::random_scene(rng, true, 0);
    s.planner.vmax_mps = rng.uniform(0.05, 1);
    s.dynamics.dt_s = std::pow(10, rng.uniform(-4, -2.5));
    s.accuracy.obstacle_error_m = std::pow(10, rng.uniform(-3.5, -2));
    s.reduce.cycle = Choice::on;
    double fastest = 0;
    for (const ScriptedObstacle& o : s.perception.obstacles)
      fastest = std::max(fastest, o.velocity_mps.norm() + 2 * M_PI * o.frequency_hz * o.amplitude_m.norm());
    reduce(s);
    const auto r = std::find_if(s.reductions.begin(), s.reductions.end(),
                                [](const auto& x) { return x.name == "cycle"; });
    const double closes = (2 * s.planner.vmax_mps + fastest) * s.planner.period_steps * s.dynamics.dt_s;
    if (!r->in_force) {
      EXPECT_EQ(s.planner.period_steps, 1);
      EXPECT_EQ(s.hurry.period_steps, 0);
      continue;
    }
    ++longer;
    EXPECT_EQ(s.hurry.period_steps, 1);
    EXPECT_LT(s.hurry.mps, 2 * s.planner.vmax_mps);
    EXPECT_NEAR(r->bound, closes, 1e-12);
    EXPECT_LE(closes, s.accuracy.obstacle_error_m * (1 + 1e-6));
    const bool longest = closes + (2 * s.planner.vmax_mps + fastest) * s.dynamics.dt_s >
                             s.accuracy.obstacle_error_m * (1 - 1e-6) ||
                         (s.planner.period_steps + 1) * s.dynamics.dt_s > 0.01 * (1 - 1e-6);
    EXPECT_TRUE(longest) << "one step more would do";
  }
  EXPECT_GT(longer, 300);
}

/// Cycles are put together in whole ones as written, and come as often as written while any point of the arm
/// is fast, whichever link it is on.
TEST(Cycle, IsAsOftenAsWrittenWhileThePointsAreFast) {
  test::Random rng(63);
  for (int k = 0; k < 200; ++k) {
    Scene s = test::random_scene(rng, k % 2 == 0, 0);
    s.perception.obstacles.clear();
    s.planner.vmax_mps = 0.1;
    s.planner.period_steps = 2;
    s.dynamics.dt_s = 1e-3;
    s.accuracy.obstacle_error_m = 1.5e-3;
    s.reduce.cycle = Choice::on;
    reduce(s);
    ASSERT_EQ(s.planner.period_steps, 6);  // 7.5 fit, and 6 are whole ones
    Cadence cadence(s);
    const int n = s.robot.chain.n();
    const Eigen::VectorXd q = rng.vector(n, 1);
    Eigen::VectorXd qd = rng.vector(n, 1), slow = qd;
    const double speed = cadence.fastest_mps(q, qd);
    qd *= 1.001 * s.hurry.mps / speed;
    slow *= 0.999 * s.hurry.mps / speed;
    for (std::uint64_t step = 0; step < 20; ++step) {
      EXPECT_EQ(cadence.due(step, q, qd), step % 2 == 0);
      EXPECT_EQ(cadence.due(step, q, slow), step % 6 == 0);
    }
    qd[0] = std::nan("");
    EXPECT_TRUE(cadence.due(2, q, qd));
  }
}

/// No point of the links, nor the end effector, goes farther in a short time than the speed found.
TEST(Cycle, KnowsTheFastestPointOfTheArm) {
  test::Random rng(65);
  double nearest = 0;
  for (int k = 0; k < 200; ++k) {
    Scene s = test::random_scene(rng, false, 0);
    test::clothe(s.robot, rng);
    const model::Chain& chain = s.robot.chain;
    Cadence cadence(s);
    const Eigen::VectorXd q = rng.vector(chain.n(), 1), qd = rng.vector(chain.n(), 1);
    const double fastest = cadence.fastest_mps(q, qd), h = 1e-6;
    rbd::Workspace a(chain), b(chain);
    rbd::positions(chain, q - h * qd, a);
    rbd::positions(chain, q + h * qd, b);
    double most = (rbd::tip(chain, b).p - rbd::tip(chain, a).p).norm() / (2 * h);
    for (const LinkShape& shape : s.robot.shapes)
      for (int i = 0; shape.link >= 0 && i < 20; ++i) {
        const geometry::Capsule c = geometry::enclosing_capsule(shape.shape);
        const bool round = shape.shape.kind == geometry::ShapeKind::capsule;
        const double radius = round ? c.radius_m : 0;
        const Eigen::Vector3d p_L = shape.X_LS * ((rng.coin(0.5) ? c.p0 : c.p1) + radius * rng.unit());
        const auto link = static_cast<std::size_t>(shape.link);
        most = std::max(most, (b.X_WB[link] * p_L - a.X_WB[link] * p_L).norm() / (2 * h));
      }
    EXPECT_LE(most, fastest * (1 + 1e-6));
    nearest = std::max(nearest, most / fastest);
  }
  EXPECT_GT(nearest, 0.95) << "half of it would not be enough";
}

}  // namespace
}  // namespace hamel::scene
