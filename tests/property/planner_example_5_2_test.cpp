// Example 5.2 of the paper, set s1, planner and midpoint integrator in the loop: the paper's figure in
// numbers.
#include <gtest/gtest.h>

#include "tests/support/planner_scene.h"

namespace hamel::test {
namespace {

using planner::Reason;
using planner::State;

RunResult run_example(const Example52& e, double dt_s = 1e-3, double duration_s = 30) {
  return run(e.robot, e.obstacles, e.options, e.goal, e.q0, dt_s, duration_s);
}

TEST(Example52, PaperLawReachesAsPublished) {
  const RunResult r = run_example(Example52());
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_NEAR(r.reached_at_s, 5.52, 0.1);
  EXPECT_NEAR(r.clearance_min_m, 0.187, 0.003);
  EXPECT_LT(r.final_error_m, 1e-9);
  EXPECT_LT(r.gyro_work_J, -5);  // the paper's mapping takes energy out: it is not gyroscopic
}

TEST(Example52, PowerlessMappingReachesSooner) {
  Example52 e;
  e.options.mapping = scene::Mapping::symmetric;
  const RunResult r = run_example(e);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_NEAR(r.reached_at_s, 5.38, 0.1);
  EXPECT_NEAR(r.clearance_min_m, 0.225, 0.003);
  EXPECT_LT(r.final_error_m, 1e-9);
  EXPECT_LT(std::abs(r.gyro_work_J), 1e-14);
}

TEST(Example52, KhatibIsStuckAndSaysSo) {
  const double expected[][3] = {{0.1, 1.14, 0.116}, {1, 1.29, 0.228}};
  for (const auto& [eta, error_m, clearance_m] : expected) {
    Example52 e;
    e.options.method = scene::Method::khatib;
    e.options.eta = eta;
    const RunResult r = run_example(e);
    EXPECT_EQ(r.last.state, State::stuck) << eta;
    EXPECT_EQ(r.last.reason, Reason::local_minimum) << eta;
    EXPECT_NEAR(r.final_error_m, error_m, 0.02) << eta;
    EXPECT_NEAR(r.clearance_min_m, clearance_m, 0.003) << eta;
    EXPECT_EQ(r.contact_at_s, -1) << eta;
  }
}

TEST(Example52, AttractionAloneCollidesAndIsUnsafe) {
  Example52 e;
  e.options.method = scene::Method::attract;
  const RunResult r = run_example(e, 1e-3, 3);
  EXPECT_EQ(r.last.state, State::unsafe);
  EXPECT_EQ(r.last.reason, Reason::contact);
  EXPECT_NEAR(r.contact_at_s, 1.0, 0.02);
  EXPECT_LT(r.qd.norm(), 1e-6);  // it brakes
}

struct Reading {
  scene::GainForm form;
  double kobs, reach_s, clearance_m;  ///< of a prototype with another integrator
};
class ForReading : public testing::TestWithParam<Reading> {};

TEST_P(ForReading, ReachesAsThePrototypeDid) {
  Example52 e;
  e.options.gain_form = GetParam().form;
  e.options.kobs = GetParam().kobs;
  const RunResult r = run_example(e, 1e-3, 15);
  EXPECT_EQ(r.last.state, State::reached);
  EXPECT_NEAR(r.reached_at_s, GetParam().reach_s, 0.1);
  EXPECT_NEAR(r.clearance_min_m, GetParam().clearance_m, 0.015);
}
INSTANTIATE_TEST_SUITE_P(GainForms, ForReading,
                         testing::Values(Reading{scene::GainForm::F2, 1, 5.25, 0.059},
                                         Reading{scene::GainForm::F2, 16, 6.11, 0.371},
                                         Reading{scene::GainForm::F3, 4, 5.44, 0.057},
                                         Reading{scene::GainForm::F3, 16, 5.89, 0.246},
                                         Reading{scene::GainForm::F1, 4, 5.58, 0.0065},
                                         Reading{scene::GainForm::F1, 16, 5.91, 0.155}));

Example52 improved() {
  Example52 e;
  e.options.method = scene::Method::gyro;
  e.options.kobs = 1;
  e.options.barrier_gain = 15;
  e.options.kc = 2;
  return e;
}

TEST(Example52, DefaultMethodReachesAndKeepsItsDistance) {
  for (const double dt_s : {1e-3, 1e-2}) {
    for (const double kobs : {1.0, 4.0}) {
      Example52 e = improved();
      e.options.kobs = kobs;
      const RunResult r = run_example(e, dt_s);
      EXPECT_EQ(r.last.state, State::reached) << dt_s;
      EXPECT_LT(r.reached_at_s, 9.5) << dt_s;
      EXPECT_GT(r.clearance_min_m, 0.9 * e.options.dmin_m) << dt_s;
      EXPECT_LT(r.final_error_m, 1e-9) << dt_s;
      EXPECT_EQ(r.stuck_at_s, -1) << dt_s;
      EXPECT_EQ(r.infeasible_cycles, 0) << dt_s;
    }
  }
}

// The four sets of parameters the example was swept with, at 10 ms: (identity), slender rods soft, rods
// stiff, rods stiff and slow.
TEST(Example52, DefaultMethodReachesInAllSetsAtTenMilliseconds) {
  struct Set {
    double inertia, kp, kv, bj, vmax;
  };
  for (const Set& s : {Set{1, 25, 20, 2, scene::kInf}, Set{1.0 / 12, 4, 8, 0.5, scene::kInf},
                       Set{1.0 / 12, 10, 6.32, 0.5, scene::kInf}, Set{1.0 / 12, 10, 6.32, 2, 1}}) {
    Example52 e = improved();
    e.robot = planar_arm(4, s.inertia, 0);
    e.options.kp = s.kp, e.options.kv = s.kv, e.options.damping = s.bj, e.options.vmax_mps = s.vmax;
    const RunResult r = run_example(e, 1e-2, 20);
    EXPECT_EQ(r.last.state, State::reached) << s.kp << " " << s.bj;
    EXPECT_LE(r.reached_at_s, 18) << s.kp << " " << s.bj;
    EXPECT_GE(r.clearance_min_m, 0.9 * e.options.dmin_m) << s.kp << " " << s.bj;
  }
}

// Kill and restart: wherever the run is cut and the arm stands still, a fresh planner finishes it.
TEST(Example52, DefaultMethodStartsAgainFromRestAnywhereOnItsWay) {
  Example52 e = improved();
  std::vector<Eigen::VectorXd> cuts;
  for (double t = 0.5; t < 8.5; t += 0.5)
    cuts.push_back(run(e.robot, e.obstacles, e.options, e.goal, e.q0, 1e-3, t).q);
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    const RunResult r = run(e.robot, e.obstacles, e.options, e.goal, cuts[k], 1e-3, 25);
    EXPECT_EQ(r.last.state, State::reached) << "cut " << k << ": " << planner::to_string(r.last.reason);
    EXPECT_GT(r.clearance_min_m, 0.5 * e.options.dmin_m) << "cut " << k;
  }
}

}  // namespace
}  // namespace hamel::test
