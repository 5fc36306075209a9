// Example 5.1 of the paper: 100 s of three links falling, against two independent solvers of 14 digits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;
const VectorXd kTheta100s = Eigen::Vector3d(-0.18375788, 0.18144555, -2.70032981);

struct Fall {
  double joint_error = 0, energy_error = 0, energy_end = 0;
  int iterations = 0, evaluations = 0, steps = 0;
};

Fall simulate(const Options& options, double horizon_s = 100) {
  const model::Chain chain = test::paper_5_1();
  const double scale = rbd::energy_scale(chain);
  Integrator integrator(chain, options);
  State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
  const double E0 = integrator.energy(s);
  Fall run;
  run.steps = static_cast<int>(std::lround(horizon_s / options.dt_s));
  for (int k = 0; k < run.steps; ++k) {
    const StepReport report = integrator.step(s, VectorXd::Zero(3));
    if (!report.usable() || report.substeps != 1) {
      ADD_FAILURE() << "step " << k;
      break;
    }
    run.iterations = std::max(run.iterations, report.iterations);
    run.evaluations += report.evaluations;
    run.energy_end = (integrator.energy(s) - E0) / scale;
    run.energy_error = std::max(run.energy_error, std::abs(run.energy_end));
  }
  run.joint_error = (s.q - kTheta100s).norm();
  return run;
}

TEST(Example51, MidpointKeepsEnergyAndCourse) {
  const Fall run = simulate({.dt_s = 0.01});
  EXPECT_LT(run.energy_error, 8e-6);
  EXPECT_LT(std::abs(run.energy_end), 3e-7);
  EXPECT_LT(run.joint_error, 1.0e-3);
  EXPECT_LT(run.evaluations, 4 * run.steps);
}

TEST(Example51, MidpointIsOfSecondOrder) {
  const double e2 = simulate({.dt_s = 0.02}).joint_error, e1 = simulate({.dt_s = 0.01}).joint_error;
  EXPECT_NEAR(std::log2(e2 / e1), 2, 0.02);
}

// The paper's own claim: at most 4 iterations at 1e-8.  And what it does not say: energy leaks.
TEST(Example51, LiteralTierDoesAsThePaperSays) {
  const Fall run =
      simulate({.tier = Tier::hamel, .dt_s = 0.01, .start = Start::previous, .tolerance_Nm = 1e-8});
  EXPECT_LE(run.iterations, 4);
  EXPECT_NEAR(run.energy_end, -1.9e-2, 1e-3);
  EXPECT_NEAR(run.joint_error, 0.58, 0.02);
}

TEST(Example51, LiteralTierIsOfFirstOrder) {
  const auto error = [](double dt) { return simulate({.tier = Tier::hamel, .dt_s = dt}, 10).energy_error; };
  EXPECT_NEAR(std::log2(error(0.01) / error(0.005)), 1, 0.05);
}

TEST(Example51, GaussReachesTheReferenceByLongSteps) {
  const Fall run = simulate({.tier = Tier::gauss, .dt_s = 0.4, .stages = 6});
  EXPECT_LT(run.joint_error, 2e-8);  // the reference has eight digits
  EXPECT_LT(run.energy_error, 1e-10);
  EXPECT_LT(run.evaluations, 18000);
}

// Every digit that the two solvers give, on both groups and by another method.
TEST(Example51, EndsAtTheReferenceToItsLastDigit) {
  for (const Options& options : {Options{.tier = Tier::gauss, .dt_s = 0.2, .stages = 8},
                                 Options{.tier = Tier::gauss, .dt_s = 0.2, .stages = 8, .space = Space::se3},
                                 Options{.tier = Tier::dopri8, .dt_s = 1, .tolerance_rel = 1e-12}}) {
    Integrator integrator(test::paper_5_1(), options);
    State s = integrator.start(VectorXd::Zero(3), VectorXd::Zero(3));
    for (int k = 0; k * options.dt_s < 100 - 1e-9; ++k)
      ASSERT_TRUE(integrator.step(s, VectorXd::Zero(3)).usable());
    EXPECT_LE((s.q - kTheta100s).lpNorm<Eigen::Infinity>(), 0.5001e-8);
  }
}

TEST(Example51, RungeKuttaIsTheHonestRival) {
  const Fall run = simulate({.tier = Tier::rk4, .dt_s = 0.01});
  EXPECT_LT(run.joint_error, 1e-7);
  EXPECT_LT(run.energy_error, 1e-9);
}

TEST(Example51, SemiImplicitEulerIsFarOff) {
  const Fall run = simulate({.tier = Tier::semi_implicit_euler, .dt_s = 0.01});
  EXPECT_NEAR(run.joint_error, 5e-3, 2e-3);
}

}  // namespace
}  // namespace hamel::dynamics
