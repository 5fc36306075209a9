// The integrator at its limits: it refuses by name, leaves the state alone, never allocates, resumes exactly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "services/dynamics/core/tier.h"
#include "tests/support/chains.h"
#include "tests/support/no_alloc.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;
const Tier kTiers[] = {Tier::hamel, Tier::midpoint, Tier::gauss, Tier::semi_implicit_euler,
                       Tier::rk4,   Tier::dopri8};

bool same(const State& a, const State& b) {
  return a.step == b.step && a.q == b.q && a.p == b.p && a.qd == b.qd && a.history == b.history;
}

class Robustness : public test::ForSeed {
 protected:
  const int n = 1 + static_cast<int>(GetParam() % 7);
  const model::Chain chain = test::random_chain(rng, n, {.damping = 0.3});
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 1), tau = rng.vector(n, 1);

  struct Pushed {
    bool flat;
    model::Chain arm;
    lie::Wrench push;
  };
  /// Every other one planar, with a wrench for its last link.
  Pushed pushed_arm() {
    const bool flat = GetParam() % 2 == 1;
    model::Chain arm = flat ? test::checked(test::random_planar_spec(rng, n, {.damping = 0.3})) : chain;
    lie::Wrench push;
    push << rng.vec3(1), rng.vec3(1);
    return {flat, std::move(arm), push};
  }
};
INSTANTIATE_TEST_SUITE_P(Property, Robustness, testing::Range(0u, 14u));

/// Every tier with every root finder, start and number of stages, on both groups.
std::vector<Options> everything() {
  std::vector<Options> all;
  for (const Space space : {Space::automatic, Space::se3}) {
    for (const Tier tier : {Tier::semi_implicit_euler, Tier::rk4, Tier::dopri8})
      all.push_back({.tier = tier, .space = space});
    for (const Tier tier : {Tier::hamel, Tier::midpoint})
      for (const Root root : {Root::feedback, Root::newton, Root::adaptive})
        for (const Start start : {Start::extrapolated, Start::previous})
          all.push_back({.tier = tier, .root = root, .start = start, .space = space});
    for (int stages = 1; stages <= 8; ++stages)
      all.push_back({.tier = Tier::gauss, .stages = stages, .space = space});
  }
  return all;
}

// 2N steps are N, save, load, N more, in another integrator.
TEST_P(Robustness, ResumesBitForBit) {
  const auto [flat, arm, push] = pushed_arm();
  for (Options options : everything()) {
    if (!flat && options.space == Space::se3) continue;  // the same arm once more
    for (const double dt_s : {1e-3, 0.05}) {             // the longer one is divided now and then
      options.dt_s = dt_s, options.stop_stiffness = 100;
      Integrator whole(arm, options), resumed(arm, options);
      ASSERT_TRUE(whole.set_wrench(n - 1, push) && resumed.set_wrench(n - 1, push));
      State a = whole.start(q, qd);
      for (int k = 0; k < 15; ++k) (void)whole.step(a, tau);
      const State saved = a;
      State b = saved;
      int usable = 0;
      for (int k = 0; k < 15; ++k) usable += whole.step(a, tau).usable();
      for (int k = 0; k < 15; ++k) usable -= resumed.step(b, tau).usable();
      EXPECT_TRUE(same(a, b) && usable == 0)
          << test::name(options.tier) << options.stages << " dt " << dt_s << " " << (a.q - b.q).norm();
      EXPECT_TRUE(dt_s > 1e-3 || a.step == 30) << test::name(options.tier);
    }
  }
}

TEST_P(Robustness, ServesManyStatesInTurn) {
  Integrator integrator(chain, {.dt_s = 1e-3}), other(chain, {.dt_s = 1e-3});
  State a = integrator.start(q, qd), b = integrator.start(qd, q), alone = a;
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(integrator.step(a, tau).usable());
    ASSERT_TRUE(integrator.step(b, tau).usable());
    ASSERT_TRUE(other.step(alone, tau).usable());
  }
  EXPECT_TRUE(same(a, alone));
}

TEST_P(Robustness, AllocatesNothingInAStep) {
  if (!test::NoAlloc::supported()) GTEST_SKIP();
  const auto [flat, arm, push] = pushed_arm();
  for (Options options : everything()) {
    if (!flat && options.space == Space::se3) continue;  // the same arm once more
    for (const double dt_s : {1e-3, 0.3}) {              // the longer one is divided, or refused
      options.dt_s = dt_s, options.stop_stiffness = 10;
      Integrator integrator(arm, options);
      State s = integrator.start(q, qd), before = s;
      VectorXd tau_g = tau, q_between = q, qd_between = qd;
      test::NoAlloc guard;
      int usable = integrator.set_wrench(n - 1, push) ? 0 : -1;
      for (int k = 0; k < 20; ++k) {
        before = s;
        usable += integrator.step(s, tau).usable();
        integrator.between(before, s, 0.3, q_between, qd_between);
        if (k == 10) integrator.clear_wrenches();
      }
      const double E = integrator.energy(s);
      integrator.gravity_torque(s.q, tau_g);
      EXPECT_EQ(guard.calls(), 0) << test::name(options.tier) << options.stages << " root "
                                  << static_cast<int>(options.root) << " dt " << dt_s << " " << usable << " "
                                  << E;
    }
  }
}

TEST_P(Robustness, LeavesStateUntouchedWhenItFails) {
  for (const Tier tier : kTiers) {
    Integrator integrator(chain, {.tier = tier, .dt_s = 10, .max_subdivisions = 0});
    State s = integrator.start(q, VectorXd::Constant(n, 100));
    const State before = s;
    const StepReport report = integrator.step(s, VectorXd::Constant(n, 1e6));
    if (report.usable()) continue;  // a single joint may well manage
    EXPECT_TRUE(same(s, before)) << test::name(tier);
  }
}

TEST_P(Robustness, RefusesWhatIsNotFinite) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const Tier tier : kTiers) {
    Integrator integrator(chain, {.tier = tier});
    for (const double bad : {nan, inf, -inf}) {
      const State good = integrator.start(q, qd);
      State s = good;
      EXPECT_EQ(integrator.step(s, bad * VectorXd::Ones(n)).stop, Stop::diverged);
      EXPECT_TRUE(same(s, good));
      for (VectorXd State::*part : {&State::q, &State::p, &State::qd}) {
        State broken = good;
        (broken.*part)[n - 1] = bad;
        EXPECT_FALSE(integrator.step(broken, tau).usable());
      }
      EXPECT_FALSE(integrator.set_wrench(n - 1, lie::Wrench::Constant(bad)));
      EXPECT_TRUE(integrator.step(s, tau).usable());  // and goes on as if nothing had been
    }
    State s;
    EXPECT_FALSE(integrator.step(s, tau).usable());
  }
}

/// Their slope is continuous and nowhere above the stiffness; their work is the change of a potential.
TEST(Stops, AreSmoothAndNoStifferThanSaid) {
  rbd::JointNumbers k;
  k.lower = -1, k.upper = 2;
  const double stiffness = 1e4, h = 1e-7;
  for (const double q : {-1.5, -1.01, -1.0001, -1.0, -0.5, 0.0, 2.0, 2.00001, 2.001, 2.1, 3.0}) {
    const auto torque = [&](double at) { return stop_torque(k, stiffness, at); };
    EXPECT_NEAR((torque(q + h) - torque(q - h)) / (2 * h), -stop_slope(k, stiffness, q), 1e-3 * stiffness)
        << q;
    EXPECT_LE(stop_slope(k, stiffness, q), stiffness);
    if (q > k.lower && q < k.upper) {
      EXPECT_EQ(torque(q), 0);
    }
    EXPECT_TRUE(q <= k.upper || torque(q) < 0);
    EXPECT_TRUE(q >= k.lower || torque(q) > 0);
  }
}

TEST(Stops, HoldTheArmNearItsLimits) {
  model::ChainSpec spec = test::planar(2, 1, 0.5, 0.02);
  for (model::Joint& j : spec.joints) j.limits.lower = -0.5, j.damping = 0.5;
  const model::Chain chain = test::checked(spec);
  for (const Tier tier : kTiers) {
    // of first order, the paper's tier still rings on these stops after 5 s at 1 ms
    const double dt = tier == Tier::hamel ? 5e-4 : 1e-3;
    Integrator integrator(chain, {.tier = tier, .dt_s = dt, .stop_stiffness = 1e4});
    State s = integrator.start(VectorXd::Zero(2), VectorXd::Zero(2));
    double lowest = 0;
    for (int k = 0; k * dt < 5; ++k) {
      ASSERT_TRUE(integrator.step(s, VectorXd::Zero(2)).usable());
      lowest = std::min(lowest, s.q.minCoeff());
    }
    EXPECT_GT(lowest, -0.6) << test::name(tier);
    EXPECT_LT(s.q[0], -0.49) << test::name(tier);
  }
}

/// At joints that carry no torque the momentum stays zero as a sum of parts that cancel: rounding must be
/// known by the parts.
TEST(Start, ATorqueAtOneJointSetsARestingArmInMotion) {
  for (const Tier tier : {Tier::midpoint, Tier::hamel})
    for (const Root root : {Root::feedback, Root::newton})
      for (const double dt_s : {1e-4, 1e-3, 1e-2}) {
        auto spec = test::planar(4, 1, 1, 1);
        spec.gravity_W_mps2.setZero();
        const model::Chain chain = test::checked(spec);
        Options options;
        options.tier = tier;
        options.root = root;
        options.dt_s = dt_s;
        Integrator integrator(chain, options);
        State state = integrator.start(Eigen::VectorXd::Zero(4), Eigen::VectorXd::Zero(4));
        const Eigen::VectorXd tau = Eigen::Vector4d(0.25, 0, 0, 0);
        for (int k = 0; k < 200; ++k) {
          const StepReport r = integrator.step(state, tau);
          ASSERT_TRUE(r.usable()) << scene::to_string(tier) << " dt " << dt_s << " step " << k;
          ASSERT_EQ(r.substeps, 1);
        }
        EXPECT_GT(state.q[0], 0);
      }
}

/// Momentum halves each few steps for a million of them: it ends in the denormal numbers, not in a refusal.
TEST(Rest, IsReachedAndKept) {
  for (const Tier tier : {Tier::midpoint, Tier::hamel}) {
    auto spec = test::planar(4, 1, 1, 1);
    spec.gravity_W_mps2.setZero();
    const model::Chain chain = test::checked(spec);
    Integrator integrator(chain, {.tier = tier, .dt_s = 1e-2});
    State state = integrator.start(Eigen::VectorXd::Zero(4), Eigen::VectorXd::Constant(4, 0.1));
    Eigen::VectorXd brake(4);
    for (int k = 0; k < 3000; ++k) {
      brake = -40 * state.p;
      ASSERT_TRUE(integrator.step(state, brake).usable()) << "step " << k << " p " << state.p.transpose();
    }
    EXPECT_LT(state.p.norm(), 1e-100);
  }
}

// Finite torque whose work is not.
TEST(Torque, BeyondAllNumbersIsRefused) {
  for (const Tier tier : kTiers) {
    Integrator integrator(test::paper_5_1(), {.tier = tier});
    State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
    const State before = s;
    for (const double tau : {1e154, 1e200, 1e300}) {
      const StepReport report = integrator.step(s, VectorXd::Constant(3, tau));
      if (report.usable()) {
        EXPECT_TRUE(std::isfinite(report.work_J) && std::isfinite(report.energy_error_J)) << test::name(tier);
        EXPECT_TRUE(s.q.allFinite() && s.qd.allFinite() && std::isfinite(integrator.energy(s)));
      } else {
        EXPECT_TRUE(same(s, before)) << test::name(tier);
      }
      s = before;
    }
  }
}

// A joint as stiff as no explicit method can follow: the adaptive one says so after its budget, it does not
// hang.
TEST(Adaptive, GivesUpAfterItsBudget) {
  model::ChainSpec spec = test::planar(3, 1, 0.5, 0.02);
  for (model::Joint& j : spec.joints) j.damping = 1e7;
  Integrator integrator(test::checked(spec), {.tier = Tier::dopri8, .dt_s = 1});
  State s = integrator.start(VectorXd::Zero(3), VectorXd::Constant(3, 1));
  const State before = s;
  const StepReport report = integrator.step(s, VectorXd::Zero(3));
  EXPECT_EQ(report.stop, Stop::budget_spent);
  EXPECT_TRUE(same(s, before));
  EXPECT_LE(report.evaluations, 2 * 5001 * 12);
}

TEST(Limits, AreReportedAndTorqueIsCut) {
  model::ChainSpec spec = test::planar(3, 1, 0.5, 0.02);
  spec.gravity_W_mps2.setZero();
  spec.joints[0].limits.effort = 2;
  spec.joints[1].limits.upper = 0.1;
  spec.joints[2].limits.velocity = 5;
  const model::Chain chain = test::checked(spec);
  for (const Tier tier : kTiers) {
    Integrator integrator(chain, {.tier = tier}), other(chain, {.tier = tier});
    const VectorXd inside = Eigen::Vector3d(0, 0.05, 0), rest = VectorXd::Zero(3);
    State s = integrator.start(inside, rest), t = s;
    StepReport r = integrator.step(s, Eigen::Vector3d(-7, 0.1, 0));
    EXPECT_EQ(r.saturated, 1) << test::name(tier);
    EXPECT_EQ(r.beyond_limits, 0);
    EXPECT_EQ(integrator.torque_applied(), Eigen::Vector3d(-2, 0.1, 0));
    r = other.step(t, Eigen::Vector3d(-2, 0.1, 0));
    EXPECT_EQ(r.saturated, 0);
    EXPECT_TRUE(same(s, t)) << "what is cut counts as what is left";
    s = integrator.start(Eigen::Vector3d(0, 0.2, 0), Eigen::Vector3d(0, 0, -6));
    r = integrator.step(s, rest);
    EXPECT_EQ(r.beyond_limits, 2) << test::name(tier);
    EXPECT_EQ(r.saturated, 0);
  }
}

TEST(Start, PutsMomentumIntoTheState) {
  const model::Chain chain = test::paper_5_1();
  const Integrator integrator(chain, {});
  const VectorXd q = Eigen::Vector3d(0.1, 0.2, 0.3), qd = Eigen::Vector3d(1, -2, 3);
  const State s = integrator.start(q, qd);
  rbd::Workspace ws(chain);
  Eigen::MatrixXd M(3, 3);
  rbd::positions(chain, q, ws);
  rbd::mass_matrix(chain, ws, M);
  EXPECT_LT((s.p - M * qd).norm(), 1e-14 * s.p.norm());
  EXPECT_LT((s.qd - qd).norm(), 1e-14);
  EXPECT_EQ(s.step, 0u);
}

TEST(GravityTorque, HoldsTheArmStill) {
  const model::Chain chain = test::paper_5_1();
  Integrator integrator(chain, {});
  State s = integrator.start(Eigen::Vector3d(0.3, -0.5, 0.7), VectorXd::Zero(3));
  VectorXd tau(3);
  const VectorXd q0 = s.q;
  for (int k = 0; k < 1000; ++k) {
    integrator.gravity_torque(s.q, tau);
    ASSERT_TRUE(integrator.step(s, tau).usable());
  }
  EXPECT_LT((s.q - q0).norm(), 1e-12);
}

}  // namespace
}  // namespace hamel::dynamics
