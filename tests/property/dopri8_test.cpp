// The adaptive rival: its table meets the order conditions, and its error follows the tolerance.
#include "services/dynamics/core/dopri8.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

using Row = std::array<double, 12>;

/// Componentwise product, and the matrix of the method applied: what order conditions are made of.
Row times(const Row& x, const Row& y) {
  Row z;
  for (std::size_t i = 0; i < 12; ++i) z[i] = x[i] * y[i];
  return z;
}
Row after(const Row& x) {
  Row z{};
  for (std::size_t i = 0; i < 12; ++i) {
    for (std::size_t j = 0; j < i; ++j) z[i] += Dop853::a[i][j] * x[j];
  }
  return z;
}
double weighed(const Row& w, const Row& x) {
  double sum = 0;
  for (std::size_t i = 0; i < 12; ++i) sum += w[i] * x[i];
  return sum;
}

/// A rooted tree as its elementary weight, order and density.
struct Tree {
  Row phi;
  int order;
  double gamma;
};

/// All rooted trees up to `order`: a root over every multiset of smaller trees.
std::vector<Tree> trees(int order) {
  std::vector<Tree> all;
  Row ones;
  ones.fill(1);
  all.push_back({ones, 1, 1});
  for (int n = 2; n <= order; ++n) {
    const std::size_t known = all.size();
    const auto grow = [&](auto&& self, std::size_t first, int left, const Row& phi, double gamma) -> void {
      if (left == 0) {
        all.push_back({phi, n, gamma * n});
        return;
      }
      for (std::size_t k = first; k < known; ++k) {
        if (all[k].order > left) continue;
        const Row grown = times(phi, after(all[k].phi));
        self(self, k, left - all[k].order, grown, gamma * all[k].gamma);
      }
    };
    grow(grow, 0, n - 1, ones, 1);
  }
  return all;
}

TEST(Dop853, MeetsAllConditionsOfOrderEight) {
  const std::vector<Tree> all = trees(8);
  EXPECT_EQ(all.size(), 1u + 1 + 2 + 4 + 9 + 20 + 48 + 115);
  for (const Tree& t : all) {
    EXPECT_NEAR(weighed(Dop853::b, t.phi), 1 / t.gamma, 2e-14) << "order " << t.order;
    if (t.order <= 3) {
      EXPECT_NEAR(weighed(Dop853::error3, t.phi), 1 / t.gamma, 1e-14);
    }
    if (t.order <= 5) {
      EXPECT_NEAR(weighed(Dop853::error5, t.phi), 0, 1e-14);
    }
  }
}

TEST(Dop853, RowsSumToTheirNodes) {
  Row ones;
  ones.fill(1);
  const Row sums = after(ones);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_NEAR(sums[i], Dop853::c[i], 2e-14);
}

TEST(Dopri8, ErrorFollowsTheTolerance) {
  const model::Chain chain = test::paper_5_1();
  const VectorXd reference = Eigen::Vector3d(-0.18375788, 0.18144555, -2.70032981);
  int before = 0;
  for (const double tolerance : {1e-6, 1e-8, 1e-10, 1e-12}) {
    Integrator integrator(chain, {.tier = Tier::dopri8, .dt_s = 10, .tolerance_rel = tolerance});
    State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
    int evaluations = 0;
    for (int k = 0; k < 10; ++k) {
      const StepReport report = integrator.step(s, VectorXd::Zero(3));
      ASSERT_TRUE(report.usable());
      evaluations += report.evaluations;
    }
    EXPECT_LT((s.q - reference).norm(), 2e-8 + 1e3 * tolerance);
    EXPECT_GT(evaluations, before);
    EXPECT_LT(evaluations, 40000);
    before = evaluations;
  }
}

}  // namespace
}  // namespace hamel::dynamics
