// Bounded reductions change results by no more than they say: each by itself, over runs of random scenes.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "clients/hamel/explain_cost.h"
#include "common/scene/reduce.h"
#include "tests/support/reduce_scene.h"
#include "tests/support/soak.h"

namespace hamel {
namespace {

/// A bound against what was found: never less, not ten times as much in the median, and half of it would be
/// caught.  In some cases the arm meets nothing of what a reduction changed and the error is 0: where most
/// cases change something they count in the median, as a bound that is infinitely idle; else it is that of
/// the cases which changed, whose share is recorded beside it.
struct Tally {
  std::vector<double> ratios;
  std::size_t changed = 0;
  std::size_t in_force = 0;
  int half_broken = 0;
  void add(double bound, double found) {
    ++in_force;
    EXPECT_LE(found, bound * (1 + 1e-6) + 1e-9);
    changed += found > 1e-9;
    ratios.push_back(found > 1e-9 ? bound / found : scene::kInf);
    half_broken += found > 0.5 * bound;
  }
  /// `least`: cases in which anything changed; `of_all`: the median is that of all cases, else of these.
  void judge(std::size_t least, bool of_all) {
    ASSERT_GE(changed, least) << "of " << in_force << " in force";
    if (!of_all) std::erase(ratios, scene::kInf);
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    EXPECT_LT(*middle, 10);
    EXPECT_GT(half_broken, 0) << "half the bound is no bound";
    testing::Test::RecordProperty("median", std::to_string(*middle));
    testing::Test::RecordProperty("half_broken", half_broken);
    testing::Test::RecordProperty("changed_of", std::to_string(changed) + "/" + std::to_string(in_force));
  }
};

/// Between two planner cycles that are farther apart than as written nothing closes in by more than the
/// bound, from singular starts too.
TEST(BoundedReductions, CyclesAreNeverTooSeldom) {
  test::Random rng(79);
  Tally tally;
  const std::size_t cases = 1000;
  for (int k = 0; k < 4000 && tally.in_force < cases; ++k) {
    SCOPED_TRACE(k);
    scene::Scene s = test::random_scene(rng, k % 2 == 0, 0);
    s.planner.vmax_mps = rng.uniform(0.1, 0.5);
    s.dynamics.dt_s = 1e-3;
    s.duration_s = 0.3;
    s.accuracy.obstacle_error_m = rng.uniform(2e-3, 1e-2);
    s.reduce.cycle = scene::Choice::on;
    scene::reduce(s);
    double bound = 0;
    for (const scene::Reduction& r : s.reductions)
      if (r.name == "cycle" && r.in_force) bound = r.bound;
    if (bound > 0) tally.add(bound, client::closed_in(s, 300));
  }
  ASSERT_EQ(tally.in_force, cases);
  tally.judge(cases * 9 / 10, true);
}

/// A random arm whose links are cylinders, a pole with a thicker end across its way and a
/// ball that swings.
scene::Scene scene_to_bound(test::Random& rng, bool planar) {
  scene::Scene s = test::random_scene(rng, planar, 0);
  s.accuracy.obstacle_error_m = std::pow(10, rng.uniform(-3, -1.3));
  s.robot.shapes.clear();
  const double most = s.accuracy.obstacle_error_m;
  for (int link = 0; link < s.robot.chain.n(); ++link) {
    const Eigen::Vector3d size(rng.uniform(0.5, 2.2) * most, rng.uniform(0.05, 0.3), 0);
    s.robot.shapes.push_back({link, {geometry::ShapeKind::cylinder, size}, rng.pose(0.15)});
  }
  const auto somewhere = [&]() -> Eigen::Vector3d {
    return s.robot.chain.X_WB0().p + rng.uniform(0.4, 1.5) * rng.unit();
  };
  s.perception.obstacles.clear();
  const Eigen::Vector3d middle = somewhere(), out = middle - s.robot.chain.X_WB0().p;
  const Eigen::Vector3d along = out.cross(rng.unit()).normalized();
  const Eigen::Matrix3d R =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along).toRotationMatrix();
  const double radius = rng.uniform(0.03, 0.1), thicker = radius + rng.uniform(0.5, 1.3) * most;
  const auto pole = [&](std::uint32_t id, double r, double from, double to) {
    scene::ScriptedObstacle o;
    o.at_start.id = id;
    o.at_start.shape = {geometry::ShapeKind::capsule, {r, to - from, 0}};
    o.at_start.X_WO = {R, middle + 0.5 * (from + to) * along};
    s.perception.obstacles.push_back(o);
  };
  pole(1, radius, -0.5, 0.5);
  pole(2, thicker, 0.5, 0.6);
  scene::ScriptedObstacle ball;
  ball.at_start = test::sphere(3, somewhere(), 0.1);
  ball.amplitude_m = rng.uniform(0.05, 0.3) * rng.unit();
  ball.frequency_hz = rng.uniform(0.3, 2);
  ball.phase_rad = rng.uniform(0, 6);
  s.perception.obstacles.push_back(ball);
  return s;
}

/// Each bounded reduction by itself keeps distances within its bound, over runs of random scenes.
class DistanceBounds : public testing::TestWithParam<scene::NamedChoice> {};
INSTANTIATE_TEST_SUITE_P(BoundedReductions, DistanceBounds,
                         testing::Values(scene::NamedChoice{"shapes", &scene::ReduceOptions::shapes},
                                         scene::NamedChoice{"merge", &scene::ReduceOptions::merge},
                                         scene::NamedChoice{"requery", &scene::ReduceOptions::requery},
                                         scene::NamedChoice{"rate", &scene::ReduceOptions::rate}),
                         [](const auto& one) { return std::string(one.param.name); });

TEST_P(DistanceBounds, HoldInEveryRun) {
  test::Random rng(77);
  Tally tally;
  const std::size_t cases = test::soak() ? 1000 : 120;  // in force
  for (std::size_t k = 0; k < 4 * cases && tally.in_force < cases; ++k) {
    SCOPED_TRACE(k);
    scene::Scene reduced = scene_to_bound(rng, k % 2 == 0);
    const std::string name = GetParam().name;
    if (name == "rate") reduced.perception.rate_hz = 1 / reduced.dynamics.dt_s;  // a set each step: the truth
    scene::Scene exact = reduced;
    reduced.reduce.*GetParam().choice = scene::Choice::on;
    scene::reduce(reduced);
    scene::reduce(exact);
    const auto r = std::find_if(reduced.reductions.begin(), reduced.reductions.end(),
                                [&](const scene::Reduction& x) { return x.name == name; });
    ASSERT_NE(r, reduced.reductions.end());
    if (!r->in_force) continue;
    EXPECT_LE(r->bound, reduced.accuracy.obstacle_error_m * (1 + 1e-9));
    // Beyond the range of every force a merged obstacle may be off by more, in proportion to how far it is.
    const double near_m = name == "merge" ? reduced.planner.rho0_m : scene::kInf;
    tally.add(r->bound, client::distance_error(reduced, exact, 100, near_m));
  }
  ASSERT_EQ(tally.in_force, cases);
  tally.judge(cases / 6, false);
}

}  // namespace
}  // namespace hamel
