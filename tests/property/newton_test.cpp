// The exact Jacobian of the midpoint step against differences of its residual.
#include <gtest/gtest.h>

#include <algorithm>

#include "services/dynamics/core/integrator.h"
#include "services/dynamics/core/midpoint.h"
#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

class Newton : public test::ForSeed {
 protected:
  const int n = std::array{1, 2, 3, 7, 12}[GetParam() % 5];
};
INSTANTIATE_TEST_SUITE_P(Property, Newton, testing::Range(0u, 40u));

TEST_P(Newton, JacobianIsTheSlopeOfTheResidual) {
  const rbd::AxisChain chain(test::random_chain(rng, n, {.prismatic = 0.4, .armature = 0.5, .damping = 0.5}));
  const double h = 0.02;
  MidpointStep<SE3> step(chain, {.dt_s = h, .root = Root::newton});
  Node<SE3> from(chain);
  from.place(chain, rng.vector(n, 3));
  from.move_with_velocity(chain, rng.vector(n, 3));
  Load<SE3> load(n);
  load.tau = rng.vector(n, 2);
  const VectorXd d = h * rng.vector(n, 5), x = rng.vector(n, 1);
  step.begin(from, load, h);
  const double e = 1e-6;
  (void)step.evaluate(d + e * x);
  VectorXd slope = step.residual();
  (void)step.evaluate(d - e * x);
  slope = ((slope - step.residual()) / (2 * e)).eval();
  (void)step.evaluate(d);
  step.linearise_and_solve();
  VectorXd back(n);
  step.solve_linear(slope, back);
  EXPECT_LT((back - x).norm(), 1e-6 * x.norm()) << "slope " << slope.transpose();
}

// Fast motion at long steps: where feedback crawls, Newton does not.
TEST_P(Newton, FindsTheSameRootInFewerEvaluations) {
  const model::Chain chain = test::random_chain(rng, n, {.mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 4);
  int evaluations[2] = {0, 0};
  VectorXd end[2];
  for (const Root root : {Root::feedback, Root::newton}) {
    Integrator integrator(chain, {.dt_s = 5e-3, .root = root});
    State s = integrator.start(q, qd);
    for (int k = 0; k < 40; ++k) {
      const StepReport report = integrator.step(s, VectorXd::Zero(n));
      ASSERT_TRUE(report.usable());
      evaluations[static_cast<int>(root)] += report.evaluations;
    }
    end[static_cast<int>(root)] = s.q;
  }
  EXPECT_LT((end[0] - end[1]).norm(), 1e-9 * (1 + end[0].norm()));
  EXPECT_LE(evaluations[1], evaluations[0] + 10);
  EXPECT_LE(evaluations[1], 4.2 * 40);
}

TEST_P(Newton, ServesThePapersTierToo) {
  const model::Chain chain = test::random_chain(rng, n, {.damping = 0.5, .mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2);
  VectorXd end[2];
  for (const Root root : {Root::feedback, Root::newton}) {
    Integrator integrator(chain, {.tier = Tier::hamel, .dt_s = 2e-3, .alpha = 0.3, .root = root});
    State s = integrator.start(q, qd);
    for (int k = 0; k < 40; ++k) {
      const StepReport report = integrator.step(s, VectorXd::Zero(n));
      ASSERT_TRUE(report.usable());
      if (root == Root::newton) {
        EXPECT_LE(report.iterations, 6);
      }
    }
    end[static_cast<int>(root)] = s.q;
  }
  EXPECT_LT((end[0] - end[1]).norm(), 1e-10 * (1 + end[0].norm()));
}

}  // namespace
}  // namespace hamel::dynamics
