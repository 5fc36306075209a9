// A planar arm on SE(2) is the same arm on SE(3): every tier, every root, every load, to rounding.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "services/dynamics/core/midpoint.h"
#include "tests/support/chains.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// Turns that add up along the chain.
VectorXd arm_signs(const rbd::PlanarChain& arm) {
  VectorXd signs(arm.n());
  for (int i = 0; i < arm.n(); ++i) signs[i] = arm[i].sign;
  return signs;
}

class Planar : public test::ForSeed {
 protected:
  const int n = 1 + static_cast<int>(GetParam() % 6);
  const model::Chain chain = test::checked(test::random_planar_spec(
      rng, n, {.prismatic = 0.3, .armature = 0.3, .damping = 0.5, .mass_spread = 0.3}));
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);

  /// The same steps on both groups end in the same state.
  void expect_same_motion(Options options, const lie::Wrench* push = nullptr) {
    options.space = Space::automatic;
    Integrator flat(chain, options);
    options.space = Space::se3;
    Integrator full(chain, options);
    ASSERT_EQ(flat.space(), Space::automatic);
    ASSERT_EQ(full.space(), Space::se3);
    State a = flat.start(q, qd), b = full.start(q, qd);
    if (push) {
      EXPECT_TRUE(flat.set_wrench(n / 2, *push) && full.set_wrench(n / 2, *push));
    }
    EXPECT_NEAR(flat.energy(a), full.energy(b), 1e-12 * (1 + std::abs(full.energy(b))));
    double work = 0;
    for (int k = 0; k < 20; ++k) {
      const StepReport ra = flat.step(a, tau), rb = full.step(b, tau);
      ASSERT_TRUE(ra.usable() && rb.usable()) << k;
      work += std::abs(rb.work_J);
      EXPECT_NEAR(ra.work_J, rb.work_J, 1e-11 * (1 + work));
    }
    EXPECT_LT((a.q - b.q).norm(), 1e-11 * (1 + b.q.norm())) << test::name(options.tier);
    EXPECT_LT((a.p - b.p).norm(), 1e-11 * (1 + b.p.norm())) << test::name(options.tier);
    EXPECT_NEAR(flat.energy(a), full.energy(b), 1e-11 * (1 + std::abs(full.energy(b))));
  }
};
INSTANTIATE_TEST_SUITE_P(Property, Planar, testing::Range(0u, 40u));

const Options kAll[] = {{.tier = Tier::midpoint, .dt_s = 2e-3},
                        {.tier = Tier::midpoint, .dt_s = 2e-3, .root = Root::newton},
                        {.tier = Tier::hamel, .dt_s = 1e-3, .alpha = 0.3},
                        {.tier = Tier::hamel, .dt_s = 1e-3, .alpha = 0.3, .root = Root::newton},
                        {.tier = Tier::gauss, .dt_s = 5e-3, .stages = 3},
                        {.tier = Tier::semi_implicit_euler, .dt_s = 1e-3},
                        {.tier = Tier::rk4, .dt_s = 2e-3},
                        {.tier = Tier::dopri8, .dt_s = 5e-3}};

TEST_P(Planar, MovesAsInSpace) {
  for (const Options& options : kAll) expect_same_motion(options);
}

TEST_P(Planar, IsPushedAsInSpace) {
  lie::Wrench push;
  push << rng.vec3(2), rng.vec3(5);
  for (const Options& options : kAll) expect_same_motion(options, &push);
}

TEST_P(Planar, AcceleratesAsInSpace) {
  const rbd::PlanarChain flat(chain);
  rbd::Sweep<SE2> sweep(n);
  rbd::Workspace ws(chain);
  VectorXd a(n), b(n), back(n);
  rbd::forward_dynamics(flat, q.data(), qd.data(), tau.data(), sweep, a.data());
  rbd::forward_dynamics(chain, q, qd, tau, ws, b);
  EXPECT_LT((a - b).norm(), 1e-11 * (1 + b.norm()));
  rbd::inverse_dynamics(flat, q.data(), qd.data(), a.data(), sweep, back.data());
  for (int i = 0; i < n; ++i) back[i] += flat[i].damping * qd[i];
  EXPECT_LT((back - tau).norm(), 1e-11 * (1 + tau.norm() + b.norm()));
}

TEST_P(Planar, JacobianIsTheSlopeOfTheResidual) {
  const rbd::PlanarChain flat(chain);
  const double h = 0.02, e = 1e-6;
  MidpointStep<SE2> step(flat, {.dt_s = h, .root = Root::newton});
  Node<SE2> from(flat);
  from.place(flat, q);
  from.move_with_velocity(flat, rng.vector(n, 3));
  Load<SE2> load(n);
  load.tau = tau;
  const VectorXd d = h * rng.vector(n, 5), x = rng.vector(n, 1);
  step.begin(from, load, h);
  (void)step.evaluate(d + e * x);
  VectorXd slope = step.residual();
  (void)step.evaluate(d - e * x);
  slope = ((slope - step.residual()) / (2 * e)).eval();
  (void)step.evaluate(d);
  step.linearise_and_solve();
  VectorXd back(n);
  step.solve_linear(slope, back);
  EXPECT_LT((back - x).norm(), 1e-6 * x.norm());
}

TEST_P(Planar, TurnsOnAsItIsPlaced) {
  const rbd::PlanarChain arm(chain);
  std::vector<rbd::PlanarFrame<double>> X(static_cast<std::size_t>(n)), Y = X;
  for (const double size : {1e-3, 0.1, 0.99, 1.01}) {  // of the bound; a link's turn is n joints' at most
    const VectorXd change =
        VectorXd::Constant(n, size * rbd::kTurnOn / (0.5 * n * (n + 1))).cwiseProduct(arm_signs(arm));
    const auto by = [&](int i) { return change[i]; };
    rbd::place(arm, VectorXd(q - change).eval().data(), X.data());
    rbd::place(arm, q.data(), Y.data());
    const bool all_turn =
        std::all_of(arm.links.begin(), arm.links.end(), [](const auto& k) { return !k.prismatic; });
    const bool near = rbd::turn_on(arm, q.data(), by, X.data());
    if (size < 1 || all_turn) {
      EXPECT_EQ(near, size < 1) << size;
    }
    if (!near) continue;
    for (std::size_t i = 0; i < X.size(); ++i) {
      const rbd::PlanarLink& k = arm.links[i];
      const double reach = std::hypot(k.p_PJ.x, k.p_PJ.y) + std::abs(q[static_cast<Eigen::Index>(i)]);
      const double moment = std::hypot(k.h.x, k.h.y);
      EXPECT_LT(std::hypot(X[i].c - Y[i].c, X[i].s - Y[i].s), 4 * kEps * (1 + q.lpNorm<1>()));
      EXPECT_LT(std::hypot(X[i].p.x - Y[i].p.x, X[i].p.y - Y[i].p.y),
                8 * kEps * (1 + q.lpNorm<1>()) * reach + 1e-300);
      EXPECT_LT(std::hypot(X[i].h.x - Y[i].h.x, X[i].h.y - Y[i].h.y),
                8 * kEps * (1 + q.lpNorm<1>()) * moment + 1e-300);
    }
  }
}

TEST_P(Planar, ResidualDoesNotDependOnTheOneBefore) {
  const rbd::PlanarChain arm(chain);
  const double h = 1e-2;
  MidpointStep<SE2> first(arm, {.dt_s = h}), second(arm, {.dt_s = h});
  Node<SE2> from(arm);
  from.place(arm, q);
  from.move_with_velocity(arm, qd);
  from.history.assign(first.history_size(), 0);
  const Load<SE2> load(n);
  first.begin(from, load, h), second.begin(from, load, h);
  const VectorXd d = h * qd;
  for (const double apart : {1e-9, 1e-6, 1e-4, 1.0}) {  // near enough to turn on, and not
    first.evaluate(d + rng.vector(n, apart));
    first.evaluate(d);
    second.begin(from, load, h);
    second.evaluate(d);
    const double size = second.residual().norm() + from.p.norm();
    EXPECT_LT((first.residual() - second.residual()).norm(), 1e-13 * size) << apart;
  }
}

TEST_P(Planar, IsSeenByItsAxesAlone) {
  EXPECT_TRUE(rbd::is_planar(chain));
  if (n == 1) return;
  model::ChainSpec spec = chain.spec();
  spec.joints.back().axis = lie::exp_so3(Eigen::Vector3d(1e-9, 1e-9, 0)) * spec.joints.back().axis;
  EXPECT_FALSE(rbd::is_planar(test::checked(spec)));
  EXPECT_EQ(Integrator(test::checked(spec), {}).space(), Space::se3);
}

TEST(NotPlanar, AreSlidesAlone) {
  model::ChainSpec spec = test::planar(2, 1, 1, 1);
  for (model::Joint& j : spec.joints) j.kind = model::JointKind::prismatic, j.axis = Eigen::Vector3d::UnitX();
  EXPECT_FALSE(rbd::is_planar(test::checked(spec)));
}

}  // namespace
}  // namespace hamel::dynamics
