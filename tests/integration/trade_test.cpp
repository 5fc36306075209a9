// Accuracy against cost: what is called best is best, and the orders of the methods show in the sweep.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "clients/hamel/trade_choice.h"
#include "tests/support/chains.h"

namespace hamel::trade {
namespace {

using Eigen::VectorXd;

Measured made_up(double error, double time) {
  Measured m;
  m.finished = true;
  m.joint_error = error, m.seconds_per_s = time, m.evaluations_per_s = time;
  return m;
}

Reference sure(double horizon_s) {
  Reference r;
  r.uncertainty = 1e-14, r.valid_s = horizon_s;
  return r;
}

class Choice : public test::ForSeed {
 protected:
  std::vector<Measured> some() {
    std::vector<Measured> all;
    for (int i = 0; i < 40; ++i) {
      all.push_back(made_up(std::pow(10, std::round(rng.uniform(-12, 0))), std::round(rng.uniform(1, 30))));
      all.back().finished = rng.coin(0.9);
      all.back().substepped = rng.coin(0.1) ? 1 : 0;
    }
    return all;
  }
};
INSTANTIATE_TEST_SUITE_P(Trade, Choice, testing::Range(0u, 50u));

TEST_P(Choice, FrontIsWhatNothingBeatsAndBeatsAllElse) {
  std::vector<Measured> all = some();
  mark_front(all, sure(1), Cost::time);
  const auto beats = [](const Measured& a, const Measured& b) {
    return a.finished && a.seconds_per_s <= b.seconds_per_s && a.joint_error <= b.joint_error &&
           (a.seconds_per_s < b.seconds_per_s || a.joint_error < b.joint_error);
  };
  for (const Measured& m : all) {
    const bool beaten = std::any_of(all.begin(), all.end(), [&](const Measured& o) { return beats(o, m); });
    const bool by_front =
        std::any_of(all.begin(), all.end(), [&](const Measured& o) { return o.on_front && beats(o, m); });
    EXPECT_EQ(m.on_front, m.finished && !beaten);
    EXPECT_EQ(beaten, by_front) << "what is beaten is beaten by one on the front";
  }
}

TEST_P(Choice, RecommendationMeetsWhatWasAskedAndNothingCheaperDoes) {
  const std::vector<Measured> all = some();
  for (const double accuracy : {1e-13, 1e-9, 1e-4, 1.0}) {
    const auto fits = [&](const Measured& m) {
      return m.finished && m.substepped == 0 && error_bound(m.joint_error, 1e-14) <= accuracy;
    };
    const auto best = recommend(all, sure(1), 1, accuracy, Cost::time);
    EXPECT_EQ(best.has_value(), std::any_of(all.begin(), all.end(), fits));
    if (!best) continue;
    EXPECT_TRUE(fits(*best));
    for (const Measured& m : all) EXPECT_FALSE(fits(m) && m.seconds_per_s < best->seconds_per_s);
  }
}

/// What lies between the instants, and what the reference is off by, count: the rule of choose.h.
TEST(Recommendation, LeavesRoomForWhatWasNotMeasured) {
  Reference r = sure(5);
  EXPECT_TRUE(recommend({made_up(0.49e-3, 1)}, r, 5, 1e-3, Cost::time));
  EXPECT_FALSE(recommend({made_up(0.51e-3, 1)}, r, 5, 1e-3, Cost::time));
  r.uncertainty = 0.02e-3;
  EXPECT_FALSE(recommend({made_up(0.49e-3, 1)}, r, 5, 1e-3, Cost::time));
}

TEST(Recommendation, SaysNothingWhereTheReferenceDoesNotReach) {
  Reference r = sure(5);
  EXPECT_TRUE(recommend({made_up(1e-6, 1)}, r, 5, 1e-4, Cost::time));
  EXPECT_FALSE(recommend({made_up(1e-6, 1)}, r, 10, 1e-4, Cost::time)) << "ends half way";
  r.uncertainty = 1e-4;
  EXPECT_FALSE(recommend({made_up(1e-6, 1)}, r, 5, 1e-4, Cost::time)) << "not surer than asked";
}

TEST(Front, ErrorsBelowTheReferencesOwnAreEqual) {
  Reference r = sure(1);
  r.uncertainty = 1e-9;
  std::vector<Measured> all{made_up(1e-10, 2), made_up(3e-10, 1)};
  mark_front(all, r, Cost::time);
  EXPECT_FALSE(all[0].on_front);
  EXPECT_TRUE(all[1].on_front);
}

class Sweep : public testing::Test {
 protected:
  const model::Chain chain = test::paper_5_1();
  const Motion motion{.chain = chain,
                      .q0 = VectorXd::Zero(3),
                      .qd0 = VectorXd::Zero(3),
                      .horizon_s = 10,
                      .base = {.dt_s = 0.01}};
  double ticks = 0;
  const Watch watch{[this] { return ticks += 1e-3; }, [] { return false; }};
};

TEST_F(Sweep, OrdersShow) {
  const Reference reference = converge(motion, watch);
  EXPECT_EQ(reference.valid_s, 10);
  EXPECT_LT(reference.uncertainty, 1e-11);
  const std::map<scene::Tier, double> orders{
      {scene::Tier::semi_implicit_euler, 1}, {scene::Tier::midpoint, 2}, {scene::Tier::rk4, 4}};
  for (const auto& [tier, order] : orders) {
    const auto error = [&](double dt_s) {
      dynamics::Options o = motion.base;
      o.tier = tier, o.dt_s = fitting_step(dt_s, motion.horizon_s);
      return measure(motion, o, reference, watch).joint_error;
    };
    EXPECT_NEAR(std::log2(error(0.02) / error(0.01)), order, 0.2) << scene::to_string(tier);
  }
}

TEST_F(Sweep, EveryCandidateIsValidFitsAndIsNotTwiceThere) {
  const auto all = candidates(motion, false);
  EXPECT_GT(all.size(), candidates(motion, true).size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_TRUE(scene::problems(all[i]).empty());
    const double steps = motion.horizon_s / kSamples / all[i].dt_s;
    EXPECT_NEAR(steps, std::round(steps), 1e-9);
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_FALSE(label(all[i]) == label(all[j]) && all[i].dt_s == all[j].dt_s) << label(all[i]);
  }
}

TEST_F(Sweep, NoStepIsLongerThanTheTick) {
  Motion m{.chain = chain,
           .q0 = motion.q0,
           .qd0 = motion.qd0,
           .horizon_s = 10,
           .tick_s = 0.05,
           .base = motion.base};
  for (const auto& o : candidates(m, false)) EXPECT_LE(o.dt_s, 0.05 * (1 + 1e-9)) << label(o);
}

TEST_F(Sweep, NothingComparedIsNoNumberAndTheFrontIsOfEnergy) {
  const Reference none;
  std::vector<Measured> all;
  for (const double dt_s : {0.02, 0.01, 0.005}) {
    dynamics::Options o = motion.base;
    o.dt_s = fitting_step(dt_s, motion.horizon_s);
    all.push_back(measure(motion, o, none, watch));
    EXPECT_TRUE(all.back().finished);
    EXPECT_TRUE(std::isnan(all.back().joint_error)) << all.back().joint_error;
  }
  all.push_back(all[0]);
  all.back().evaluations_per_s *= 2;  // dearer, and no better
  mark_front(all, none, Cost::evaluations);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(all[k].on_front) << k;
  EXPECT_FALSE(all[3].on_front);
  EXPECT_FALSE(recommend(all, none, motion.horizon_s, 1, Cost::time));
}

TEST_F(Sweep, MomentumIsJudgedOnlyWhereItStays) {
  EXPECT_FALSE(first_momentum_stays(chain, {}));
  model::ChainSpec spec = test::planar(3, 1, 0.1, 1);
  spec.gravity_W_mps2 = {0, 0, -9.81};
  EXPECT_TRUE(first_momentum_stays(test::checked(spec), {}));
  spec.joints[0].damping = 1;
  EXPECT_FALSE(first_momentum_stays(test::checked(spec), {}));
}

TEST_F(Sweep, EndsWhenToldTo) {
  int asked = 0;
  const Watch impatient{[] { return 0.0; }, [&asked] { return ++asked > 3; }};
  const Reference reference = converge(motion, impatient);
  EXPECT_FALSE(measure(motion, motion.base, reference, impatient).finished);
  EXPECT_LT(asked, 20);
}

}  // namespace
}  // namespace hamel::trade
