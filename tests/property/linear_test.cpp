// What a step costs grows with the number of joints and no faster: operations of an evaluation exactly,
// evaluations of a step not at all.
#include "tests/support/counted.h"
// first, so that the recursions know it

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "services/dynamics/core/gauss_stages.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

using test::Counted;
using Numbers = std::vector<Counted>;

long operations(const std::function<void()>& work) {
  Counted::operations = 0;
  work();
  return Counted::operations;
}
/// The same work for chains of n joints: what the next joint adds is always the same.
void expect_linear(const std::function<long(int n)>& operations_of) {
  const long two = operations_of(2), each = operations_of(3) - two;
  EXPECT_GT(each, 0);
  for (const int n : {7, 30, 100, 300, 1000})
    EXPECT_EQ(operations_of(n), two + (n - 2) * each) << n << " joints";
}

template <class G>
class Recursion : public testing::Test {
 protected:
  static typename G::Chain chain(int n) {
    return typename G::Chain(test::checked(test::planar(n, 1, 0.1, 0.01)));
  }
};
using Groups = testing::Types<SE3, SE2>;
TYPED_TEST_SUITE(Recursion, Groups);

TYPED_TEST(Recursion, OfForwardDynamicsIsLinear) {
  using G = TypeParam;
  expect_linear([&](int n) {
    const auto chain = this->chain(n);
    const auto size = static_cast<std::size_t>(n);
    std::vector<typename G::template Frame<Counted>> X(size);
    std::vector<typename G::template Motion<Counted>> F(size);
    std::vector<rbd::Factor<G, Counted>> factor(size);
    Numbers q(size, {0.1}), qd(size, {1}), u(size), qdd(size);
    return operations([&] {
      rbd::place(chain, q.data(), X.data());
      rbd::factorise<G, Counted>(chain, X.data(), nullptr, factor.data());
      // what the motion costs beyond that is in a stage's evaluation, below
      rbd::solve<G, Counted>(chain, X.data(), factor.data(), q.data(), u.data(), rbd::into(qdd.data()),
                             F.data());
    });
  });
}

TYPED_TEST(Recursion, OfAStageIsLinear) {
  using G = TypeParam;
  expect_linear([&](int n) {
    const auto chain = this->chain(n);
    const auto size = static_cast<std::size_t>(n);
    Load<G> load(n);
    load.pushed = true;
    const double a = 0.5;
    const std::vector<double> q(size, 0.1), p(size, 0.2), inertia(size, 1), past(2 * size, 0.3);
    std::vector<double> V(size), F(size), V_next(size), F_next(size), applied(size), scale_inv(size);
    std::vector<unsigned char> scratch(scratch_bytes<G>(n));
    StageJob<G> job;
    job.chain = &chain, job.load = &load, job.tau = load.tau.data();
    job.h = 0.01, job.stop_stiffness = 1, job.stages = job.padded = 1, job.a = job.extrapolate = &a;
    job.past = past.data(), job.scale_inv = scale_inv.data();
    job.q = q.data(), job.p = p.data(), job.inertia = inertia.data(), job.V = V.data(), job.F = F.data();
    job.V_next = V_next.data(), job.F_next = F_next.data(), job.applied = applied.data();
    job.scratch = scratch.data();
    return operations([&] { evaluate_stages<G, Counted>(job); });
  });
}

/// A hanging arm, bent a little at every joint and let go.
void expect_few_evaluations(int n, double bend, unsigned seed, Options options) {
  test::Random rng(seed);
  const model::Chain chain = test::checked(test::hanging(n));
  Integrator integrator(chain, options);
  State s = integrator.start(rng.vector(n, bend), VectorXd::Zero(n));
  int worst = 0;
  for (int k = 0; k < 60; ++k) {
    const StepReport report = integrator.step(s, VectorXd::Zero(n));
    ASSERT_TRUE(report.usable() && report.substeps == 1) << n << " joints, step " << k;
    worst = std::max(worst, report.evaluations);
  }
  EXPECT_LE(worst, 5) << n << " joints bent by " << bend;
}

TEST(Evaluations, OfABentChainAreAtMostFive) {
  for (const Root root : {Root::adaptive, Root::newton})
    for (const int n : {3, 7, 30, 100, 300, 1000})
      for (const unsigned seed : {1u, 2u}) {
        expect_few_evaluations(n, std::min(0.1, 0.7 / n), seed, {.dt_s = 1e-3, .root = root});
      }
}

/// Feedback is tried now and then, and given up where one exact Jacobian costs less.
TEST(Evaluations, OfALongTautChainStayFew) {
  const int n = 1000, steps = 600;
  test::Random rng(1);
  Integrator integrator(test::checked(test::hanging(n)), {.dt_s = 1e-3});
  State s = integrator.start(rng.vector(n, 0.7 / n), VectorXd::Zero(n));
  int evaluations = 0;
  for (int k = 0; k < steps; ++k) {
    const StepReport report = integrator.step(s, VectorXd::Zero(n));
    ASSERT_TRUE(report.usable() && report.substeps == 1) << "step " << k;
    evaluations += report.evaluations;
  }
  EXPECT_LE(evaluations, 2.5 * steps);
}

TEST(Evaluations, OfAPlanarChainThatFallsAreAtMostFive) {
  for (const int n : {3, 30, 300, 1000}) {
    const model::Chain chain = test::checked(test::planar(n, 1.0 / n, 1.0 / n, 1e-2 / n));
    Integrator integrator(chain, {.dt_s = 1e-4});
    State s = integrator.start(VectorXd::Zero(n), VectorXd::Zero(n));
    for (int k = 0; k < 20; ++k) {
      const StepReport report = integrator.step(s, VectorXd::Zero(n));
      ASSERT_TRUE(report.usable()) << n << " joints, step " << k;
      EXPECT_LE(report.evaluations, 5) << n << " joints, step " << k;
    }
  }
}

}  // namespace
}  // namespace hamel::dynamics
