// When an iteration that finds a root may stop, and how fast it is said to be.
#include "services/dynamics/core/increment_root.h"

#include <gtest/gtest.h>

#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

/// An equation whose root is zero and whose updates leave of each part of the error a share of its own.
struct Parts {
  VectorXd share;
  Residual evaluate(const VectorXd& x) const {
    const double size = x.lpNorm<Eigen::Infinity>();
    return {size, size};
  }
  void correct(VectorXd& x) const { x = x.cwiseProduct(share); }
};

class Parted : public testing::TestWithParam<unsigned> {};
INSTANTIATE_TEST_SUITE_P(Unit, Parted, testing::Range(0u, 200u));

/// The last update is not looked at, and yet what it leaves is rounding: parts that fall slowly hide behind
/// the others, and are remembered from the step before.
TEST_P(Parted, EndsAtTheRootAlsoWhereItDoesNotLook) {
  test::Random rng(GetParam());
  const int n = 8;
  Parts equation{rng.vector(n, 0.2).cwiseAbs()};
  Past past;
  int unseen = 0;
  for (int step = 0; step < 20; ++step) {
    VectorXd x = rng.vector(n, 1);
    for (double& part : x) part = std::copysign(std::pow(10, -2 - 10 * std::abs(part)), part);
    x[0] = 1e-2;
    Contraction contraction(n, past);
    const StepReport report = find_root(equation, {}, contraction, x);
    ASSERT_EQ(report.stop, Stop::converged);
    unseen += report.evaluations == report.iterations;
    if (step > 3) {
      EXPECT_LE(x.lpNorm<Eigen::Infinity>(), 2 * kRounding) << "step " << step;
    }
    past.rate = std::max(past.rate, contraction.seen());
  }
  EXPECT_GT(unseen, 0) << "the case is not about what was asked";
}

/// As many updates are said to be needed as a constant share takes.
TEST(Contraction, CountsTheUpdatesOfAConstantShare) {
  for (const double share : {0.5, 0.1, 1e-3}) {
    Contraction contraction(1);
    double residual = 1;
    for (int k = 0; k < 3; ++k, residual *= share) contraction.see(residual);
    residual /= share;
    EXPECT_NEAR(contraction.pace(), share, 1e-12 * share);
    int updates = 1;
    while (residual * std::pow(share, updates - 1) > kRounding) ++updates;
    EXPECT_TRUE(contraction.needs(updates - 1)) << share;
    EXPECT_FALSE(contraction.needs(updates + 1)) << share;
  }
}

/// One update that gains little after one that gained much is no slow iteration, though the careful rate
/// says so.
TEST(Contraction, OneIdleUpdateMakesNoSlowPace) {
  Contraction contraction(1000);
  for (const double residual : {3e-4, 5e-7, 2e-7, 2e-9}) contraction.see(residual);
  EXPECT_NEAR(contraction.rate(), 0.4, 1e-12);
  EXPECT_LT(contraction.pace(), 0.1);
}

}  // namespace
}  // namespace hamel::dynamics
