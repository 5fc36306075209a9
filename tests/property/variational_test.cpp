// What makes an integrator variational, over random chains: structure that ordinary methods lose.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

StepReport step_from(const model::Chain& chain, const Options& options, VectorXd& q, VectorXd& p) {
  Integrator integrator(chain, options);
  State s = integrator.start(q, VectorXd::Zero(q.size()));
  s.p = p;
  const StepReport report = integrator.step(s, VectorXd::Zero(q.size()));
  q = s.q, p = s.p;
  return report;
}

/// By how much the differences below move q and p: their own error, of order e^4, is then below rounding.
constexpr double kMove = 3e-4;
/// What rounding alone makes of a symplectic step's defect: each of four steps is known to 2 eps |(q, p)|,
/// their weights sum to 18 / (12 e), and J enters twice.
double difference_floor(const VectorXd& q, const VectorXd& p) {
  const double size = 1 + std::max(q.lpNorm<Eigen::Infinity>(), p.lpNorm<Eigen::Infinity>());
  return 2 * (18.0 / 12) * 2 * std::numeric_limits<double>::epsilon() * size / kMove;
}

/// |J^T Omega J - Omega| of the one-step map's Jacobian J by central differences.
double symplectic_defect(const model::Chain& chain, const Options& options, const VectorXd& q,
                         const VectorXd& p) {
  const Eigen::Index n = q.size();
  MatrixXd J(2 * n, 2 * n), Omega = MatrixXd::Zero(2 * n, 2 * n);
  Omega.topRightCorner(n, n).setIdentity();
  Omega.bottomLeftCorner(n, n) = -MatrixXd::Identity(n, n);
  const double e = kMove;
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    const auto moved = [&](double s) {
      VectorXd z(2 * n);
      z << q, p;
      z[i] += s;
      VectorXd a = z.head(n), b = z.tail(n);
      const StepReport report = step_from(chain, options, a, b);
      EXPECT_TRUE(report.usable() && report.substeps == 1);
      z << a, b;
      return z;
    };
    // fourth-order differences
    J.col(i) = (8 * (moved(e) - moved(-e)) - (moved(2 * e) - moved(-2 * e))) / (12 * e);
  }
  return (J.transpose() * Omega * J - Omega).cwiseAbs().maxCoeff() / J.cwiseAbs().maxCoeff();
}

class Variational : public test::ForSeed {
 protected:
  const int n = 1 + static_cast<int>(GetParam() % 5);
};
INSTANTIATE_TEST_SUITE_P(Property, Variational, testing::Range(0u, 20u));

/// What must be symplectic: tiers and sizes of step.
const Options kSymplectic[] = {{.tier = Tier::midpoint, .dt_s = 0.01},
                               {.tier = Tier::midpoint, .dt_s = 0.001},
                               {.tier = Tier::midpoint, .dt_s = 0.01, .root = Root::newton},
                               {.tier = Tier::gauss, .dt_s = 0.01, .stages = 1},
                               {.tier = Tier::gauss, .dt_s = 0.02, .stages = 2},
                               {.tier = Tier::gauss, .dt_s = 0.02, .stages = 3},
                               {.tier = Tier::gauss, .dt_s = 0.04, .stages = 4},
                               {.tier = Tier::gauss, .dt_s = 0.04, .stages = 5},
                               {.tier = Tier::gauss, .dt_s = 0.04, .stages = 6},
                               {.tier = Tier::gauss, .dt_s = 0.04, .stages = 7},
                               {.tier = Tier::gauss, .dt_s = 0.04, .stages = 8},
                               {.tier = Tier::midpoint, .dt_s = 0.1},
                               {.tier = Tier::midpoint, .dt_s = 0.1, .root = Root::newton},
                               {.tier = Tier::gauss, .dt_s = 0.1, .stages = 2},
                               {.tier = Tier::gauss, .dt_s = 0.1, .stages = 4},
                               {.tier = Tier::gauss, .dt_s = 0.1, .stages = 8}};

TEST_P(Variational, StepIsSymplectic) {
  const model::Chain chain = test::random_chain(rng, n, {.mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), p = rng.vector(n, 0.5);
  for (const Options& options : kSymplectic)
    EXPECT_LT(symplectic_defect(chain, options, q, p), difference_floor(q, p))
        << test::name(options.tier) << options.stages << " dt " << options.dt_s;
}

// One Gauss point is the midpoint rule.
TEST_P(Variational, GaussOfOneStageIsMidpoint) {
  const model::Chain chain = test::random_chain(rng, n, {.damping = 0.5, .mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
  Integrator one(chain, {.tier = Tier::midpoint, .dt_s = 5e-3}),
      other(chain, {.tier = Tier::gauss, .dt_s = 5e-3, .stages = 1});
  State a = one.start(q, qd), b = other.start(q, qd);
  double work = 0;
  for (int k = 0; k < 20; ++k) {
    const StepReport ra = one.step(a, tau), rb = other.step(b, tau);
    ASSERT_TRUE(ra.usable() && rb.usable());
    work += std::abs(ra.work_J);
    EXPECT_NEAR(ra.work_J, rb.work_J, 1e-12 * (1 + work));
  }
  EXPECT_LT((a.q - b.q).norm(), 1e-11 * (1 + a.q.norm()));
  EXPECT_LT((a.p - b.p).norm(), 1e-11 * (1 + a.p.norm()));
}

TEST(Symplectic, TestSeesTheDefectOfThePapersTier) {
  const model::Chain chain = test::paper_5_1();
  const VectorXd q = Eigen::Vector3d(0.3, 0.8, -1.1), p = Eigen::Vector3d(1, 3, 2);
  EXPECT_GT(symplectic_defect(chain, {.tier = Tier::hamel, .dt_s = 0.01}, q, p), 1e-5);
  EXPECT_LT(symplectic_defect(chain, {.tier = Tier::midpoint, .dt_s = 0.01}, q, p), difference_floor(q, p));
}

/// The tiers that are their own inverse with time reversed, and keep momenta.
std::vector<Options> symmetric_tiers(double dt_s) {
  std::vector<Options> all{{.tier = Tier::midpoint, .dt_s = dt_s},
                           {.tier = Tier::midpoint, .dt_s = dt_s, .root = Root::newton}};
  for (int stages = 1; stages <= 8; ++stages)
    all.push_back({.tier = Tier::gauss, .dt_s = stages > 1 ? 4 * dt_s : dt_s, .stages = stages});
  return all;
}

TEST_P(Variational, TimeRunsBackToTheStart) {
  const model::Chain chain = test::random_chain(rng, n, {.mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
  for (const Options& options : symmetric_tiers(1e-3)) {
    Integrator integrator(chain, options);
    State s = integrator.start(q, qd);
    const State begin = s;
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator.step(s, tau).usable());
    s.p = -s.p;
    s.history.assign(s.history.size(), 0);
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator.step(s, tau).usable());
    EXPECT_LT((s.q - begin.q).norm(), 1e-9 * (1 + begin.q.norm()))
        << test::name(options.tier) << options.stages;
    EXPECT_LT((s.p + begin.p).norm(), 1e-9 * (1 + begin.p.norm()))
        << test::name(options.tier) << options.stages;
  }
}

// The guard bites: the paper's own tier and the explicit one do not come back.
TEST(TimeReversal, IsNotGivenToAll) {
  const model::Chain chain = test::paper_5_1();
  for (const Tier tier : {Tier::hamel, Tier::semi_implicit_euler}) {
    Integrator integrator(chain, {.tier = tier, .dt_s = 1e-3});
    State s = integrator.start(Eigen::Vector3d(0.3, 0.8, -1.1), Eigen::Vector3d(1, 2, -1));
    const State begin = s;
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator.step(s, VectorXd::Zero(3)).usable());
    s.p = -s.p, s.qd = -s.qd;
    s.history.assign(s.history.size(), 0);
    for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator.step(s, VectorXd::Zero(3)).usable());
    EXPECT_GT((s.q - begin.q).norm(), 1e-7) << test::name(tier);
  }
}

// Turning the whole arm about joint 1 changes nothing when there is no gravity: its momentum stays.
TEST_P(Variational, MomentumAboutTheFirstAxisStaysWithoutGravity) {
  const model::Chain chain = test::random_chain(rng, n, {.gravity = false});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2);
  for (const Options& options : symmetric_tiers(1e-3)) {
    Integrator integrator(chain, options);
    State s = integrator.start(q, qd);
    const double p0 = s.p[0], scale = s.p.cwiseAbs().maxCoeff();
    const int steps = 500;
    for (int k = 0; k < steps; ++k) ASSERT_TRUE(integrator.step(s, VectorXd::Zero(n)).usable());
    EXPECT_LT(std::abs(s.p[0] - p0), steps * 2e-15 * (scale + std::abs(p0)))
        << test::name(options.tier) << options.stages;
  }
}

/// The state after `time_s`, by steps of dt.
VectorXd travel(const model::Chain& chain, Options options, const VectorXd& q, const VectorXd& qd,
                const VectorXd& tau, double time_s, int steps) {
  options.dt_s = time_s / steps;
  Integrator integrator(chain, options);
  State s = integrator.start(q, qd);
  for (int k = 0; k < steps; ++k) EXPECT_TRUE(integrator.step(s, tau).usable());
  VectorXd z(2 * q.size());
  z << s.q, s.qd;
  return z;
}

TEST_P(Variational, TiersAgreeOnTheMotion) {
  const model::Chain chain = test::random_chain(rng, n, {.damping = 0.5, .mass_spread = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
  const VectorXd reference = travel(chain, {.tier = Tier::rk4}, q, qd, tau, 0.2, 800);
  EXPECT_LT((travel(chain, {.tier = Tier::midpoint}, q, qd, tau, 0.2, 2000) - reference).norm(), 1e-4);
  EXPECT_LT((travel(chain, {.tier = Tier::hamel}, q, qd, tau, 0.2, 2000) - reference).norm(), 2e-2);
}

TEST_P(Variational, WorkIsTheChangeOfEnergy) {
  const model::Chain chain = test::random_chain(rng, n, {.armature = 1, .damping = 1, .mass_spread = 0.3});
  for (const Tier tier : {Tier::midpoint, Tier::rk4, Tier::gauss}) {
    Integrator integrator(chain, {.tier = tier, .dt_s = 1e-4});
    State s = integrator.start(rng.vector(n, 3), rng.vector(n, 1));
    const VectorXd tau = rng.vector(n, 1);
    const double E0 = integrator.energy(s);
    double work = 0, effort = 0;
    for (int k = 0; k < 1000; ++k) {
      const StepReport report = integrator.step(s, tau);
      ASSERT_TRUE(report.usable());
      work += report.work_J;
      effort += std::abs(report.work_J);
    }
    EXPECT_NEAR(integrator.energy(s) - E0, work, 1e-5 * (effort + std::abs(E0))) << test::name(tier);
  }
}

TEST(Energy, StaysBoundedOverManySwings) {
  const model::Chain chain = test::paper_5_1();
  const double scale = rbd::energy_scale(chain);
  Integrator integrator(chain, {.dt_s = 0.02});
  State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
  const double E0 = integrator.energy(s);
  double early = 0, late = 0;
  for (int k = 0; k < 200000; ++k) {
    ASSERT_TRUE(integrator.step(s, VectorXd::Zero(3)).usable());
    double& worst = k < 100000 ? early : late;
    worst = std::max(worst, std::abs(integrator.energy(s) - E0) / scale);
  }
  EXPECT_LT(early, 4e-5);
  EXPECT_LT(late, 1.1 * early);
}

}  // namespace
}  // namespace hamel::dynamics
