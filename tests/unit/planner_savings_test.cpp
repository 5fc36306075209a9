// Distances that are not measured in each cycle: commands stay the same to the last bit, and distances
// reported are off by no more than was allowed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "services/planner/core/planner.h"
#include "tests/support/reduce_scene.h"

namespace hamel::test {
namespace {

using planner::Planner;
using planner::Savings;

/// An arm that swings among obstacles that stand, drift, or do not say.
struct Swing {
  scene::Scene scene;
  std::vector<geometry::Obstacle> set;
  Eigen::VectorXd q, qd, reach, rate;

  Swing(Random& rng, double speed) : scene(random_scene(rng, false, 0)) {
    const int n = scene.robot.chain.n();
    for (std::size_t b = 0; b < scene.robot.shapes.size(); ++b)
      for (std::size_t a = 0; a < b; ++a)
        if (scene.robot.shapes[a].link < scene.robot.shapes[b].link - 1)
          scene.robot.self_pairs.emplace_back(a, b);
    for (const scene::ScriptedObstacle& o : scene.perception.obstacles) {
      set.push_back(o.at_start);
      set.back().V_WO.tail<3>() = o.velocity_mps;
      if (rng.coin(0.1)) set.back().velocity_known = false;
    }
    q = qd = scene.q0;
    reach = rng.vector(n, 0.5);
    rate = rng.vector(n, speed);
  }
  void at(double t_s) {
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      q[i] = scene.q0[i] + reach[i] * std::sin(rate[i] * t_s);
      qd[i] = reach[i] * rate[i] * std::cos(rate[i] * t_s);
    }
  }
};

bool same(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

/// Two planners side by side over 50 cycles of 2 ms with a set every 40 ms; `compare` after each.
template <class Compare>
void side_by_side(Swing& swing, const Savings& savings, Compare compare) {
  Planner a(swing.scene.robot, swing.scene.planner), b(swing.scene.robot, swing.scene.planner, savings);
  a.set_goal(*swing.scene.goal);
  b.set_goal(*swing.scene.goal);
  planner::Output x = a.output(), y = b.output();
  for (std::uint64_t k = 0; k < 50; ++k) {
    const double t_s = 2e-3 * static_cast<double>(k), age_s = 2e-3 * static_cast<double>(k % 20);
    if (k > 0 && k % 20 == 0)
      for (geometry::Obstacle& o : swing.set) o.X_WO.p += 0.04 * o.V_WO.tail<3>();
    swing.at(t_s);
    const planner::Input in{.step = k,
                            .t_s = t_s,
                            .dt_s = 2e-3,
                            .q = swing.q,
                            .qd = swing.qd,
                            .obstacles = swing.set,
                            .obstacle_age_s = age_s,
                            .obstacle_set = 1 + k / 20};
    a.plan(in, x);
    b.plan(in, y);
    ASSERT_TRUE(same(x.torque_Nm, y.torque_Nm)) << "cycle " << k;
    EXPECT_EQ(x.report.state, y.report.state);
    EXPECT_EQ(x.report.reason, y.report.reason);
    EXPECT_EQ(x.report.contacts, y.report.contacts);
    EXPECT_EQ(x.report.pairs_in_range, y.report.pairs_in_range);
    EXPECT_EQ(x.report.barrier_rows, y.report.barrier_rows);
    compare(x.report, y.report);
  }
}

TEST(FarLinks, PassedOverChangeNothing) {
  Random rng(71);
  for (int k = 0; k < 100; ++k) {
    Swing swing(rng, k % 2 == 0 ? 1 : 10);
    side_by_side(swing, {.far_links = true}, [](const planner::Report& x, const planner::Report& y) {
      EXPECT_EQ(x.clearance_m, y.clearance_m);
      for (std::size_t i = 0; i < x.links.size(); ++i)
        EXPECT_EQ(x.links[i].distance_m, y.links[i].distance_m);
    });
  }
}

TEST(SeldomAsked, LinksReportWithinTheBoundAndCommandsStay) {
  Random rng(73);
  std::vector<double> ratios;
  int half_broken = 0;
  for (int k = 0; k < 1000; ++k) {
    Swing swing(rng, 1);
    const double bound = std::pow(10, rng.uniform(-4, -2));
    double worst = 0;
    side_by_side(swing, {.requery_m = bound}, [&](const planner::Report& x, const planner::Report& y) {
      for (std::size_t i = 0; i < x.links.size(); ++i)
        if (std::isfinite(x.links[i].distance_m))
          worst = std::max(worst, std::abs(x.links[i].distance_m - y.links[i].distance_m));
    });
    EXPECT_LE(worst, bound * (1 + 1e-9));
    if (worst > 0) ratios.push_back(bound / worst);
    half_broken += worst > 0.5 * bound;
  }
  ASSERT_GT(ratios.size(), 300u);
  std::nth_element(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2),
                   ratios.end());
  EXPECT_LT(ratios[ratios.size() / 2], 10);
  EXPECT_GT(half_broken, 0) << "half the bound is no bound";
}

}  // namespace
}  // namespace hamel::test
