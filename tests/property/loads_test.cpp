// What may act on an arm or be asked of it beside joint torque: wrenches, payload, states inside a step, the
// torque of a discrete motion; and the lanes in which stages are computed.
#include <gtest/gtest.h>

#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/discrete_inverse.h"
#include "services/dynamics/core/gauss.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Loads : public test::ForSeed {
 protected:
  const int n = 1 + static_cast<int>(GetParam() % 6);
  const bool flat = GetParam() % 2 == 1;
  const model::ChainSpec spec = flat ? test::random_planar_spec(rng, n, {.mass_spread = 0.3})
                                     : test::random_spec(rng, n, {.mass_spread = 0.3});
  const model::Chain chain = test::checked(spec);
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
  lie::Wrench push = lie::Wrench::Zero();
  int link = 0;
  void SetUp() override {
    push << rng.vec3(1), rng.vec3(3);
    link = n / 2;
  }
  VectorXd travel(Options options, int steps, double& made_up) {
    options.dt_s = 0.2 / steps;
    Integrator integrator(chain, options);
    EXPECT_TRUE(integrator.set_wrench(link, push));
    State s = integrator.start(q, qd);
    for (int k = 0; k < steps; ++k) {
      const StepReport r = integrator.step(s, tau);
      EXPECT_TRUE(r.usable());
      made_up += r.energy_error_J;
    }
    VectorXd z(2 * n);
    z << s.q, s.qd;
    return z;
  }
};
INSTANTIATE_TEST_SUITE_P(Property, Loads, testing::Range(0u, 24u));

TEST_P(Loads, AWrenchActsThroughTheJacobian) {
  rbd::Workspace ws(chain);
  rbd::positions(chain, q, ws);
  MatrixXd J(6, n);
  rbd::frame_jacobian(chain, ws, link, ws.X_WB[static_cast<std::size_t>(link)].p, J);
  const VectorXd by_hand = tau + J.transpose() * push;
  Integrator a(chain, {.tier = Tier::rk4, .dt_s = 1e-7}), b(chain, {.tier = Tier::rk4, .dt_s = 1e-7});
  ASSERT_TRUE(a.set_wrench(link, push));
  State sa = a.start(q, qd), sb = b.start(q, qd);
  ASSERT_TRUE(a.step(sa, tau).usable() && b.step(sb, by_hand).usable());
  EXPECT_LT((sa.qd - sb.qd).norm(), 1e-11 * (1 + sb.qd.norm()));
  a.clear_wrenches();
  sa = a.start(q, qd), sb = b.start(q, qd);
  ASSERT_TRUE(a.step(sa, tau).usable() && b.step(sb, tau).usable());
  EXPECT_EQ((sa.qd - sb.qd).norm(), 0);
}

TEST_P(Loads, AWrenchCostsNoOrderAndItsWorkIsCounted) {
  struct Case {
    Options options;
    double order;
    int steps;
  };
  for (const Case& c :
       {Case{{.tier = Tier::midpoint}, 2, 200}, Case{{.tier = Tier::midpoint, .root = Root::newton}, 2, 200},
        Case{{.tier = Tier::gauss, .stages = 2}, 4, 20}, Case{{.tier = Tier::rk4}, 4, 100}}) {
    double coarse_J = 0, fine_J = 0, finest_J = 0;
    const VectorXd coarse = travel(c.options, c.steps, coarse_J),
                   fine = travel(c.options, 2 * c.steps, fine_J),
                   finest = travel(c.options, 4 * c.steps, finest_J);
    EXPECT_NEAR(std::log2((coarse - fine).norm() / (fine - finest).norm()), c.order, 0.25)
        << test::name(c.options.tier);
    EXPECT_LT(std::abs(finest_J), 0.01 + 0.2 * std::abs(coarse_J)) << test::name(c.options.tier);
  }
}

TEST_P(Loads, APayloadIsAHeavierLastLink) {
  model::Inertia body;
  body.mass_kg = 0.7;
  body.com_m = rng.vec3(0.2);
  body.about_com_kgm2 = Eigen::Vector3d(0.02, 0.03, 0.04).asDiagonal();
  Integrator integrator(chain, {.dt_s = 1e-3});
  State s = integrator.start(q, qd);
  const double before = integrator.energy(s);
  ASSERT_TRUE(integrator.set_payload(body, s).empty());
  rbd::Workspace ws(chain);
  rbd::velocities(chain, q, qd, ws);
  const lie::Pose X_WE = rbd::tip(chain, ws);
  MatrixXd J(6, n);
  rbd::frame_jacobian(chain, ws, n - 1, X_WE * body.com_m, J);
  const lie::Twist V = J * qd;
  const Eigen::Vector3d w = X_WE.R.transpose() * V.head<3>();
  const double added = 0.5 * (w.dot(body.about_com_kgm2 * w) + body.mass_kg * V.tail<3>().squaredNorm()) -
                       body.mass_kg * chain.gravity_W_mps2().dot(X_WE * body.com_m);
  EXPECT_NEAR(integrator.energy(s) - before, added, 1e-11 * (1 + std::abs(before) + std::abs(added)));
  EXPECT_LT((s.qd - qd).norm(), 1e-12 * (1 + qd.norm()));
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(integrator.step(s, tau).usable());
  body.mass_kg = -1;
  EXPECT_FALSE(integrator.set_payload(body, s).empty());
  EXPECT_TRUE(integrator.set_payload({}, s).empty());  // laid down again
  State fresh = Integrator(chain, {.dt_s = 1e-3}).start(s.q, s.qd);
  EXPECT_LT((fresh.p - s.p).norm(), 1e-11 * (1 + s.p.norm()));
}

TEST_P(Loads, AStateInsideAStepLiesOnTheMotion) {
  for (const Tier tier : {Tier::midpoint, Tier::gauss}) {
    const auto error = [&](double h) {
      Integrator integrator(chain, {.tier = tier, .dt_s = h, .stages = 4});
      Integrator exact(chain, {.tier = Tier::gauss, .dt_s = h * 0.37, .stages = 8});
      State a = integrator.start(q, qd), b = a, c = exact.start(q, qd);
      EXPECT_TRUE(integrator.step(b, tau).usable() && exact.step(c, tau).usable());
      VectorXd x(n), v(n);
      integrator.between(a, b, 1, x, v);
      EXPECT_LT((x - b.q).norm() + (v - b.qd).norm(), 1e-12 * (1 + b.q.norm() + b.qd.norm()));
      integrator.between(a, b, 0, x, v);
      EXPECT_LT((x - a.q).norm() + (v - a.qd).norm(), 1e-11 * (1 + a.q.norm() + a.qd.norm()));
      integrator.between(a, b, 0.37, x, v);
      return (x - c.q).norm();
    };
    const double coarse = error(0.04), fine = error(0.02);
    EXPECT_LT(coarse, 1e-3);
    EXPECT_LT(fine, coarse * (tier == Tier::gauss ? 0.1 : 0.5) + 1e-10) << test::name(tier);
  }
}

TEST_P(Loads, DiscreteInverseDynamicsFindsTheTorqueOfThePapersSteps) {
  rbd::Workspace ws(chain);
  for (const double alpha : {0.0, 0.3, 1.0}) {
    Integrator integrator(chain, {.tier = Tier::hamel, .dt_s = 1e-2, .alpha = alpha, .space = Space::se3});
    State s = integrator.start(q, qd);
    std::vector<VectorXd> path{s.q};
    for (int k = 0; k < 4; ++k) {
      const StepReport r = integrator.step(s, tau);
      ASSERT_TRUE(r.usable());
      if (r.substeps > 1) return;
      path.push_back(s.q);
    }
    VectorXd found(n);
    for (std::size_t k = 1; k + 1 < path.size(); ++k) {
      discrete_inverse_dynamics(chain, path[k - 1], path[k], path[k + 1], 1e-2, alpha, ws, found);
      EXPECT_LT((found - tau).norm(), 1e-8 * (1 + tau.norm() + s.p.norm()))
          << "alpha " << alpha << " step " << k;
    }
  }
}

template <class G>
void expect_same_bits(const typename G::Chain& chain, int stages, const VectorXd& q, const VectorXd& qd,
                      const VectorXd& tau) {
  const Options options{.tier = Tier::gauss, .dt_s = 0.01, .stages = stages};
  Load<G> load(chain.n());
  load.tau = tau;
  Node<G> from(chain), first(chain), other(chain);
  from.place(chain, q);
  from.move_with_velocity(chain, qd);
  from.move_with_momentum(chain);
  for (const Lanes lanes : {Lanes::baseline, Lanes::avx2, Lanes::avx512}) {
    if (!stage_kernel<G>(lanes)) continue;
    GaussStep<G> step(chain, options, lanes);
    from.history.assign(step.history_size(), 0);
    Node<G>& to = lanes == Lanes::baseline ? first : other;
    to.history = from.history;
    ASSERT_TRUE(step.advance(from, load, 0.01, to).usable());
    EXPECT_TRUE(to.q == first.q && to.p == first.p && to.history == first.history) << static_cast<int>(lanes);
  }
}

TEST_P(Loads, LanesOfAnyWidthGiveTheSameBits) {
  VectorXd far = q;
  far[0] += 1e7;  // a sine from the library
  for (int stages = 1; stages <= 8; ++stages) {
    for (const VectorXd& at : {q, far}) {
      expect_same_bits<SE3>(rbd::AxisChain(chain), stages, at, qd, tau);
      if (rbd::is_planar(chain)) expect_same_bits<SE2>(rbd::PlanarChain(chain), stages, at, qd, tau);
    }
  }
}

/// Torque, damping, stops, a wrench and a payload at once: energy is what work says, and the report's ledger
/// sums what is left.
TEST_P(Loads, WorkOfAllThatActsIsTheChangeOfEnergy) {
  model::ChainSpec braked = spec;
  for (model::Joint& j : braked.joints) j.damping = 0.3, j.limits.lower = -2, j.limits.upper = 2;
  const model::Chain arm = test::checked(braked);
  struct Case {
    Options options;
    double bound;
  };
  for (const Case& c : {Case{{.tier = Tier::midpoint, .stop_stiffness = 200}, 2e-5},
                        Case{{.tier = Tier::midpoint, .root = Root::newton, .stop_stiffness = 200}, 2e-5},
                        Case{{.tier = Tier::gauss, .stages = 4, .stop_stiffness = 200}, 1e-7},
                        Case{{.tier = Tier::rk4, .stop_stiffness = 200}, 1e-7}}) {
    Integrator integrator(arm, c.options);
    State s = integrator.start(q, qd);
    model::Inertia body{0.3, Eigen::Vector3d(0.1, 0, 0.05), 0.01 * Eigen::Matrix3d::Identity()};
    ASSERT_TRUE(integrator.set_payload(body, s).empty());
    EXPECT_TRUE(integrator.set_wrench(link, push));
    const double E0 = integrator.energy(s);
    double work = 0, made_up = 0, effort = 0;
    for (int k = 0; k < 300; ++k) {
      const StepReport r = integrator.step(s, tau);
      ASSERT_TRUE(r.usable());
      work += r.work_J, made_up += r.energy_error_J, effort += std::abs(r.work_J);
      EXPECT_NEAR(r.made_up_J, made_up, 1e-12 * (1 + effort + std::abs(E0)));
    }
    const double scale = 1 + effort + std::abs(E0);
    EXPECT_NEAR(integrator.energy(s) - E0, work + made_up, 1e-11 * scale);
    EXPECT_LT(std::abs(made_up), c.bound * scale) << test::name(c.options.tier);
  }
}

}  // namespace
}  // namespace hamel::dynamics
