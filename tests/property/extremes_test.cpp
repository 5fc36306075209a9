// Models, states and steps at the edge: every tier either keeps a stated bound on its energy, or refuses for
// a reason that is allowed.  Heavy damping at any step.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"
#include "tests/support/tiers.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;

/// Energy error, of the energy in play, by the order of the tier: the second, higher, the first.
struct Kept {
  double second = 1e-5, higher = 1e-9, first = 1e-2;
};
struct Extreme {
  const char* name;
  model::ChainSpec spec;
  double angle, rate, dt_s;
  int steps = 100;
  Kept kept = {};
};
void PrintTo(const Extreme& e, std::ostream* out) { *out << e.name; }

model::ChainSpec with_masses(double first, double last) {
  model::ChainSpec spec = test::planar(3, 1, 0.5, 0.05);
  for (const auto& [link, mass] : {std::pair{0, first}, std::pair{2, last}}) {
    model::Inertia& body = spec.links[static_cast<std::size_t>(link)].inertia;
    body.mass_kg *= mass, body.about_com_kgm2 *= mass;
  }
  return spec;
}
/// Slender rods: no inertia to speak of about their own axis, which joint 3 turns about.
model::ChainSpec needles() {
  model::ChainSpec spec = test::planar(3, 1, 0.5, 0.02);
  for (model::Link& link : spec.links)
    link.inertia.about_com_kgm2 = Eigen::Vector3d(1e-9, 0.02, 0.02 + 0.5e-9).asDiagonal();
  spec.joints[1].axis = Eigen::Vector3d::UnitY();
  spec.joints[2].axis = Eigen::Vector3d::UnitX();
  return spec;
}
model::ChainSpec of_zero_length() {
  model::ChainSpec spec = test::planar(3, 1, 0, 0.05);
  spec.joints[1].axis = Eigen::Vector3d::UnitX();
  spec.joints[2].axis = Eigen::Vector3d::UnitY();
  return spec;
}
model::ChainSpec slides() {
  model::ChainSpec spec = test::planar(3, 1, 0.5, 0.05);
  for (model::Joint& joint : spec.joints) joint.kind = model::JointKind::prismatic;
  spec.joints[0].axis = Eigen::Vector3d::UnitX(), spec.joints[1].axis = Eigen::Vector3d::UnitY();
  return spec;
}

const Extreme kExtremes[] = {
    {"light_tip", with_masses(1, 1e-6), 0.3, 0, 1e-3, 500},
    {"heavy_base", with_masses(1e6, 1), 0.3, 0, 1e-3, 500},
    {"inertia_1e_9", test::planar(3, 1e-6, 1e-2, 1e-9), 0.4, 1, 1e-4},
    {"links_of_1e_4_m", test::planar(3, 1e-3, 1e-4, 1e-9), 0.4, 1, 1e-4},
    {"links_of_1e3_m", test::planar(3, 1e3, 1e3, 1e8), 0.4, 0.1, 1e-2},
    {"rates_of_1e3", test::planar(3, 1, 0.1, 0.01), 0.4, 1e3, 1e-5},
    {"step_of_1e_7_s", test::planar(3, 1, 0.5, 0.1), 0.4, 1, 1e-7},
    {"step_of_1_s", test::planar(3, 1, 0.1, 1), 0.4, 0.01, 1, 30, {0.1, 0.1, 0.5}},
    {"wound_to_1e6", test::planar(3, 1, 0.1, 1), 1e6, 1, 1e-2},
    {"needles", needles(), 0.3, 0.5, 1e-4},
    {"links_of_zero_length", of_zero_length(), 0.3, 1, 1e-3},
    {"slides", slides(), 0.3, 1, 1e-2, 100, {.first = 0.05}},
};

class Extremes : public testing::TestWithParam<Extreme> {};
INSTANTIATE_TEST_SUITE_P(Property, Extremes, testing::ValuesIn(kExtremes),
                         [](const auto& row) { return row.param.name; });

/// Every tier and root; RK4 may lose more than others of its order.
struct Way {
  Options options;
  double Kept::*kept;
  double slack = 1;
};
const Way kEvery[] = {{{.tier = Tier::midpoint, .root = Root::feedback}, &Kept::second},
                      {{.tier = Tier::midpoint, .root = Root::newton}, &Kept::second},
                      {{.tier = Tier::gauss, .stages = 2}, &Kept::higher},
                      {{.tier = Tier::gauss, .stages = 8}, &Kept::higher},
                      {{.tier = Tier::rk4}, &Kept::higher, 10},
                      {{.tier = Tier::dopri8}, &Kept::higher},
                      {{.tier = Tier::hamel, .root = Root::feedback}, &Kept::first},
                      {{.tier = Tier::hamel, .root = Root::newton}, &Kept::first},
                      {{.tier = Tier::semi_implicit_euler}, &Kept::first}};

TEST_P(Extremes, IntegratesWithinItsBound) {
  const Extreme& e = GetParam();
  const model::Chain chain = test::checked(e.spec);
  for (auto [options, kept, slack] : kEvery) {
    options.dt_s = e.dt_s;
    Integrator integrator(chain, options);
    State s = integrator.start(Eigen::Vector3d(e.angle, e.angle - 0.7, e.angle + 0.3),
                               VectorXd::Constant(3, e.rate));
    const double E0 = integrator.energy(s), in_play = 0.5 * s.p.dot(s.qd) + rbd::energy_scale(chain);
    double worst = 0;
    for (int k = 0; k < e.steps; ++k) {
      const StepReport report = integrator.step(s, VectorXd::Zero(3));
      ASSERT_TRUE(report.usable()) << test::name(options.tier) << " step " << k << " stop "
                                   << static_cast<int>(report.stop) << " residual " << report.residual_Nm;
      worst = std::max(worst, std::abs(integrator.energy(s) - E0) / in_play);
    }
    EXPECT_LT(worst, slack * e.kept.*kept) << test::name(options.tier) << options.stages;
  }
}

TEST(MassRatio, OfAMillionEitherWay) {
  for (const double ratio : {1e-6, 1e6}) {
    model::ChainSpec spec = test::planar(2, 1, 0.5, 0.05);
    spec.links[1].inertia.mass_kg *= ratio;
    spec.links[1].inertia.about_com_kgm2 *= ratio;
    const model::Chain chain = test::checked(spec);
    Integrator integrator(chain, {.dt_s = 1e-3});
    State s = integrator.start(VectorXd::Constant(2, 0.3), VectorXd::Zero(2));
    const double E0 = integrator.energy(s);
    for (int k = 0; k < 2000; ++k)
      ASSERT_TRUE(integrator.step(s, VectorXd::Zero(2)).usable()) << ratio << " " << k;
    EXPECT_LT(std::abs(integrator.energy(s) - E0), 1e-4 * rbd::energy_scale(chain));
  }
}

// Two light links before a heavy one are thrown round in microseconds when the arm is stretched, at 0.255 s:
// a collision but for the name.  The adaptive tier follows it; for the others 1 ms is 1600 times their bound
// (below): they keep their energy up to there and then refuse.
TEST(MassRatio, WhipIsFollowedOrRefused) {
  const model::Chain chain = test::checked(with_masses(1, 1e6));
  for (const Tier tier : {Tier::midpoint, Tier::gauss, Tier::dopri8}) {
    Integrator integrator(chain, {.tier = tier, .dt_s = 1e-3});
    State s = integrator.start(Eigen::Vector3d(0.3, -0.4, 0.6), VectorXd::Zero(3));
    const double E0 = integrator.energy(s), scale = rbd::energy_scale(chain);
    int usable = 0;
    while (usable < 500 && integrator.step(s, VectorXd::Zero(3)).usable()) ++usable;
    EXPECT_GE(usable, tier == Tier::dopri8 ? 500 : 250) << test::name(tier);
    EXPECT_LT(std::abs(integrator.energy(s) - E0), 1e-3 * scale) << test::name(tier);
  }
}

/// How fast small deviations change: the largest |eigenvalue| of d(qd, qdd) / d(q, qd) without torque [1/s].
double fastest_rate(const model::Chain& chain, const State& s) {
  const int n = chain.n();
  rbd::Workspace ws(chain);
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  J.topRightCorner(n, n).setIdentity();
  const VectorXd none = VectorXd::Zero(n);
  const double step = 1e-6 * std::max(1.0, s.qd.norm());
  VectorXd ahead(n), behind(n);
  for (int j = 0; j < n; ++j) {
    const VectorXd a = 1e-6 * VectorXd::Unit(n, j), b = step * VectorXd::Unit(n, j);
    rbd::forward_dynamics(chain, s.q + a, s.qd, none, ws, ahead);
    rbd::forward_dynamics(chain, s.q - a, s.qd, none, ws, behind);
    J.col(j).tail(n) = (ahead - behind) / 2e-6;
    rbd::forward_dynamics(chain, s.q, s.qd + b, none, ws, ahead);
    rbd::forward_dynamics(chain, s.q, s.qd - b, none, ws, behind);
    J.col(n + j).tail(n) = (ahead - behind) / (2 * step);
  }
  return Eigen::EigenSolver<Eigen::MatrixXd>(J, false).eigenvalues().cwiseAbs().maxCoeff();
}

/// The whip above between 0.25 s and 0.26 s, while two light links are thrown round.
struct Whip {
  static constexpr double kTime_s = 0.01;
  explicit Whip(double ratio) : chain(test::checked(with_masses(1, ratio))) {
    Integrator fall(chain, exact(1e-2));
    begin = fall.start(Eigen::Vector3d(0.3, -0.4, 0.6), VectorXd::Zero(3));
    for (int k = 0; k < 25; ++k) EXPECT_TRUE(fall.step(begin, VectorXd::Zero(3)).usable());
    end = begin;
    State fast = begin;  // two steps before the fastest rate seen
    watch(end, kTime_s / 1000, 1000, &fast);
    State near = fast;
    watch(near, kTime_s / 1e6, 4000, nullptr);
  }
  static Options exact(double dt_s) { return {.tier = Tier::dopri8, .dt_s = dt_s, .tolerance_rel = 1e-12}; }
  void watch(State& s, double dt_s, int steps, State* two_before) {
    Integrator integrator(chain, exact(dt_s));
    State last = s, before = s;
    for (int k = 0; k < steps; ++k) {
      before = last, last = s;
      EXPECT_TRUE(integrator.step(s, VectorXd::Zero(3)).usable());
      const double rate = fastest_rate(chain, s);
      if (rate > omega && two_before) *two_before = before;
      omega = std::max(omega, rate);
    }
  }
  model::Chain chain;
  State begin, end;
  double omega = 0;  ///< the largest rate on the way [1/s]
};

struct Followed {
  bool usable = true;
  int substeps = 1;  ///< the most of a step
  double energy = 0, joints = 0;
};
Followed follow(const Whip& whip, Options options, double dt_omega) {
  const int steps = static_cast<int>(std::ceil(Whip::kTime_s * whip.omega / dt_omega));
  options.dt_s = Whip::kTime_s / steps;
  Integrator integrator(whip.chain, options);
  State s = integrator.start(whip.begin.q, whip.begin.qd);
  const double E0 = integrator.energy(s), scale = rbd::energy_scale(whip.chain);
  Followed out;
  for (int k = 0; k < steps && out.usable; ++k) {
    const StepReport report = integrator.step(s, VectorXd::Zero(3));
    out.usable = report.usable();
    out.substeps = std::max(out.substeps, report.substeps);
    out.energy = std::max(out.energy, std::abs(integrator.energy(s) - E0) / scale);
  }
  out.joints = (s.q - whip.end.q).norm();
  return out;
}

// The bound: a step of at most 1/omega is taken whole, by the midpoint and by every gauss, however stiff the
// arm; max_subdivisions = 6 carries on to 64/omega, with no more promise than the guards' on energy.
TEST(MassRatio, StepsUpToTheFastestRateFollowTheWhip) {
  struct {
    Options options;
    double energy, joints;
  } const kTiers[] = {{{.tier = Tier::midpoint}, 2e-3, 2e-2},
                      {{.tier = Tier::gauss, .stages = 2}, 2e-4, 1e-3},
                      {{.tier = Tier::gauss, .stages = 4}, 1e-6, 1e-5},
                      {{.tier = Tier::gauss, .stages = 8}, 1e-10, 1e-9}};
  for (const double ratio : {1e2, 1e3, 1e4, 1e5, 1e6}) {
    const Whip whip(ratio);
    EXPECT_NEAR(whip.omega, 1.6 * ratio, 0.1 * ratio);
    for (const auto& tier : kTiers) {
      SCOPED_TRACE(test::name(tier.options.tier) + std::to_string(tier.options.stages) + " at " +
                   std::to_string(ratio));
      const Followed whole = follow(whip, tier.options, 1);
      EXPECT_TRUE(whole.usable && whole.substeps == 1) << whole.substeps;
      EXPECT_LT(whole.energy, tier.energy);
      EXPECT_LT(whole.joints, tier.joints);
      for (const double dt_omega : {2., 8., 64.}) {
        const Followed divided = follow(whip, tier.options, dt_omega);
        EXPECT_TRUE(divided.usable) << dt_omega;
        EXPECT_LT(divided.energy, 0.1) << dt_omega;
      }
    }
  }
}

TEST(Winding, ChangesNothing) {
  const model::Chain chain = test::paper_5_1();
  Integrator integrator(chain, {.dt_s = 1e-2});
  const double turns = 2 * M_PI * 159155;
  State near = integrator.start(VectorXd::Constant(3, 0.4), VectorXd::Zero(3));
  State far = integrator.start(VectorXd::Constant(3, 0.4 + turns), VectorXd::Zero(3));
  for (int k = 0; k < 500; ++k) {
    ASSERT_TRUE(integrator.step(near, VectorXd::Zero(3)).usable());
    ASSERT_TRUE(integrator.step(far, VectorXd::Zero(3)).usable());
  }
  EXPECT_LT(((far.q.array() - turns).matrix() - near.q).norm(), 1e-6);
}

// Damping that takes the momentum thousands of times over in one step: implicit tiers take the step whole,
// and all give the same creeping motion.
TEST(Damping, OfAnyStrengthIsTakenInOneStep) {
  for (const double c : {1.0, 10.0, 100.0, 1e3}) {
    model::ChainSpec spec = test::planar(3, 1, 0.5, 0.02);
    for (model::Joint& j : spec.joints) j.damping = c;
    const model::Chain chain = test::checked(spec);
    const auto creep = [&](Options options, double dt_s, int steps) {
      options.dt_s = dt_s;
      Integrator integrator(chain, options);
      State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
      for (int k = 0; k < steps; ++k) {
        const StepReport report = integrator.step(s, VectorXd::Zero(3));
        EXPECT_TRUE(report.usable() && report.substeps == 1)
            << test::name(options.tier) << options.stages << " c " << c;
      }
      return s.q;
    };
    const VectorXd truth = creep({.tier = Tier::gauss, .stages = 3}, 1e-3, 1000);
    for (const double dt_s : {0.01, 0.1}) {
      const int steps = static_cast<int>(std::lround(1 / dt_s));
      for (const Root root : {Root::feedback, Root::newton})
        EXPECT_LT((creep({.tier = Tier::midpoint, .root = root}, dt_s, steps) - truth).norm(),
                  0.3 * dt_s + 1e-3)
            << c;
      for (const int stages : {1, 2, 3, 4, 6})
        EXPECT_LT((creep({.tier = Tier::gauss, .stages = stages}, dt_s, steps) - truth).norm(),
                  0.3 * dt_s + 1e-3)
            << c << " stages " << stages;
    }
  }
}

// A free joint under constant torque is integrated without error, at any step.
TEST(Prismatic, SlideFallsByTheBook) {
  model::ChainSpec spec = test::planar(1, 2, 0, 1);
  spec.joints[0].kind = model::JointKind::prismatic;
  spec.joints[0].axis = Eigen::Vector3d::UnitY();
  const model::Chain chain = test::checked(spec);
  for (const Tier tier : {Tier::midpoint, Tier::gauss, Tier::rk4, Tier::dopri8}) {
    Integrator integrator(chain, {.tier = tier, .dt_s = 0.1});
    State s = integrator.start(VectorXd::Zero(1), VectorXd::Constant(1, 3));
    for (int k = 0; k < 10; ++k) ASSERT_TRUE(integrator.step(s, VectorXd::Constant(1, 4)).usable());
    EXPECT_NEAR(s.q[0], 3 + 0.5 * (4. / 2 - 9.81), 1e-13) << test::name(tier);
    EXPECT_NEAR(s.qd[0], 3 + (4. / 2 - 9.81), 1e-13) << test::name(tier);
  }
}

}  // namespace
}  // namespace hamel::dynamics
