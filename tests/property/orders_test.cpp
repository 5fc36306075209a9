// Orders of convergence by Richardson's slopes, with torque, damping, armature and an outer wrench: forces
// must not cost a tier its order.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;

/// A loaded arm and where it is after a while.
struct Motion {
  model::Chain chain;
  VectorXd q, qd, tau;
  lie::Wrench push;
  double time_s;

  /// NaN where a step had to be divided.
  VectorXd end(Options options, int steps) const {
    options.dt_s = time_s / steps, options.max_iterations = 200;
    Integrator integrator(chain, options);
    EXPECT_TRUE(integrator.set_wrench(chain.n() - 1, push));
    State s = integrator.start(q, qd);
    VectorXd z = VectorXd::Constant(2 * q.size(), std::nan(""));
    for (int k = 0; k < steps; ++k) {
      const StepReport report = integrator.step(s, tau);
      if (!report.usable() || report.substeps > 1) return z;
    }
    z << s.q, s.qd;
    return z;
  }
};
Motion some_motion(test::Random& rng, int n, double time_s) {
  model::Chain chain = test::random_chain(rng, n, {.armature = 1, .damping = 1, .mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
  lie::Wrench push;
  push << rng.vec3(0.5), rng.vec3(3);
  return {std::move(chain), q, qd, tau, push, time_s};
}

class Orders : public test::ForSeed {};
INSTANTIATE_TEST_SUITE_P(Property, Orders, testing::Range(0u, 20u));

/// Steps in the window between the step where asymptotics begin and rounding; each row's are multiplied by
/// 3/2 twice.
struct Case {
  Options options;
  double order;
  int steps;
};
const Case kCases[] = {{{.tier = Tier::semi_implicit_euler}, 1, 1600},
                       {{.tier = Tier::hamel, .alpha = 0}, 1, 1600},
                       {{.tier = Tier::hamel, .alpha = 0.5}, 1, 1600},
                       {{.tier = Tier::hamel, .alpha = 1}, 1, 1600},
                       {{.tier = Tier::hamel, .alpha = 0.5, .root = Root::newton}, 1, 1600},
                       {{.tier = Tier::midpoint, .root = Root::feedback}, 2, 64},
                       {{.tier = Tier::midpoint, .root = Root::newton}, 2, 64},
                       {{.tier = Tier::gauss, .stages = 1}, 2, 64},
                       {{.tier = Tier::gauss, .stages = 2}, 4, 24},
                       {{.tier = Tier::gauss, .stages = 3}, 6, 12},
                       {{.tier = Tier::rk4}, 4, 64}};

TEST_P(Orders, ShowInRichardsonSlopesUnderLoad) {
  const int n = 1 + static_cast<int>(GetParam() % 5);
  const Motion motion = some_motion(rng, n, 0.4);
  for (const Case& c : kCases) {
    if (n == 1 && c.options.tier == Tier::hamel) continue;  // one joint: nothing to lag behind, order 2
    const VectorXd coarse = motion.end(c.options, c.steps), middle = motion.end(c.options, c.steps * 3 / 2),
                   fine = motion.end(c.options, c.steps * 9 / 4);
    const double slope = std::log((coarse - middle).norm() / (middle - fine).norm()) / std::log(1.5);
    EXPECT_NEAR(slope, c.order, 0.1) << test::name(c.options.tier) << " stages " << c.options.stages
                                     << " alpha " << c.options.alpha;
  }
}

/// Slope of the error against a reference over a factor of 5/4 in the step, the last one that is well above
/// rounding: high orders leave no window for three runs.
double high_slope(const Motion& motion, int stages) {
  const VectorXd truth = motion.end({.tier = Tier::gauss, .stages = 8}, 120);
  const auto error = [&](int steps) {
    return (motion.end({.tier = Tier::gauss, .stages = stages}, steps) - truth).norm() / (1 + truth.norm());
  };
  double slope = std::nan("");
  for (int k = 1; k < 30; ++k) {
    const double coarse = error(4 * k), fine = error(5 * k);
    if (fine < 1e-12) break;
    if (coarse < 1e-4) slope = std::log(coarse / fine) / std::log(1.25);
  }
  return slope;
}

TEST(HighOrders, EightShowsInTheMedianOfManyLoadedMotions) {
  std::vector<double> slopes;
  for (unsigned seed = 0; seed < 25; ++seed) {
    test::Random rng(seed);
    const double slope = high_slope(some_motion(rng, 2, 2), 4);
    if (std::isfinite(slope)) slopes.push_back(slope);
  }
  ASSERT_GT(slopes.size(), 15u);
  std::sort(slopes.begin(), slopes.end());
  EXPECT_NEAR(slopes[slopes.size() / 2], 8, 0.1);
}

// Between the step where asymptotics begin and rounding a window of two slopes is left; order 16 leaves none.
TEST(HighOrders, EightAndTwelveShowOnFastRods) {
  const VectorXd zero = VectorXd::Zero(3);
  const Motion rods{test::fast_rods(), zero, zero, zero, lie::Wrench::Zero(), 1};
  for (const int stages : {4, 6}) {
    const auto at = [&](int steps) { return rods.end({.tier = Tier::gauss, .stages = stages}, steps); };
    const VectorXd coarse = at(16), middle = at(32), fine = at(64);
    EXPECT_NEAR(std::log2((coarse - middle).norm() / (middle - fine).norm()), 2 * stages, 0.5) << stages;
  }
}

}  // namespace
}  // namespace hamel::dynamics
