/// Whose command moves the arm where several planners speak, and what it does when none does.  In process,
/// the test gives the time.

#include <gtest/gtest.h>

#include "services/dynamics/service.h"
#include "tests/support/services.h"

using namespace hamel;
using runtime::Clock;
using test::four_link;
using test::made;
using test::node;
using namespace std::chrono_literals;

namespace {

/// A planner of the test's own: one writer of commands.
struct Commander {
  explicit Commander(bus::Node& n) : out(n) {}
  void say(const dynamics::DynamicsService& d, std::uint64_t epoch, std::uint64_t incarnation,
           double torque_Nm) {
    wire::TorqueCommand c;
    c.arm = 1;
    c.epoch = epoch;
    c.state_incarnation = incarnation;
    c.step = d.arm().state().step;
    c.torque = wire::JointVector::Zero(4);
    c.torque[0] = torque_Nm;
    out.publish(c);
  }
  wire::Publisher<wire::TorqueCommand> out;
};

class Planners : public testing::Test {
 protected:
  /// Each polled once in this order; the torque that the arm was given over the next step.
  double applied(std::vector<std::pair<Commander*, std::pair<std::uint64_t, double>>> said) {
    const auto before = arm->arm().state().step;
    for (const auto& [who, what] : said) who->say(*arm, what.first, 1, what.second);
    arm->poll(now += 1ms);
    EXPECT_EQ(arm->arm().state().step, before + 1);
    return arm->arm().torque_applied()[0];
  }
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = node(21);
  scene::Scene s = four_link();
  std::unique_ptr<dynamics::DynamicsService> arm = made(dynamics::DynamicsService::make(*n, s, {}));
  Commander a{*n}, b{*n};
};

TEST_F(Planners, OfEqualEpochsTheOneThatHasTheArmKeepsIt) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(applied({{&b, {1, 0.2}}, {&a, {1, 0.1}}}), 0.1) << "never mixed";
}

TEST_F(Planners, TheLargerEpochTakesOverAndStays) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  EXPECT_EQ(applied({{&b, {2, 0.2}}, {&a, {1, 0.1}}}), 0.2);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.2) << "never mixed";
}

TEST_F(Planners, ASlowStrongerOneTakesOverToo) {
  EXPECT_EQ(applied({{&a, {1, 0.1}}}), 0.1);
  EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.1) << "this step was answered";
  EXPECT_EQ(applied({{&a, {1, 0.1}}, {&b, {2, 0.2}}}), 0.2);
}

/// In real time: `drive` of `from`, until the arm is at `step`.
class RealTime : public testing::Test {
 protected:
  void poll() {
    arm->poll(now += 1ms);
    incarnation();
  }
  std::uint64_t incarnation() {
    wire::ArmState state;
    while (states.take(state)) last = state;
    return last.incarnation;
  }
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = node(22);
  scene::Scene s = four_link({"gravity_mps2=[0, 0, 0]"});
  wire::Subscription<wire::ArmState> states{*n};
  wire::ArmState last;
  std::unique_ptr<dynamics::DynamicsService> arm =
      made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime}));
  Commander a{*n}, b{*n};
};

TEST_F(RealTime, AWeakerPlannerTakesOverOnceTheStrongerIsSilent) {
  poll();
  for (int i = 0; i < 100; ++i) {
    a.say(*arm, 9, incarnation(), 0.1);
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
  }
  wire::ArmState state;
  for (int i = 0; i < 300; ++i) {
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
    if (i == 40) {
      EXPECT_EQ(last.validity, wire::Validity::valid) << "the last command of a is not stale yet";
    }
  }
  incarnation();
  EXPECT_EQ(last.validity, wire::Validity::valid);
  EXPECT_NEAR(last.torque_applied[0], 0.2, 1e-12);
  for (int i = 0; i < 300; ++i) {
    a.say(*arm, 9, incarnation(), 0.1);
    b.say(*arm, 1, incarnation(), 0.2);
    poll();
  }
  incarnation();
  EXPECT_NEAR(last.torque_applied[0], 0.1, 1e-12) << "the stronger one is back";
}

TEST_F(RealTime, AfterASilenceTheCommandComesInOverTheRampWithoutAJump) {
  for (int i = 0; i < 10; ++i) poll();
  a.say(*arm, 1, incarnation(), 1.0);
  poll();
  incarnation();
  EXPECT_EQ(last.torque_applied[0], 1) << "the run's first command starts it";
  for (int i = 0; i < 400; ++i) poll();
  incarnation();
  EXPECT_EQ(last.validity, wire::Validity::command_stale);
  EXPECT_LT(last.velocity.lpNorm<Eigen::Infinity>(), 1e-3) << "it holds";
  double before = last.torque_applied[0], most = 0;
  for (int i = 0; i < 400; ++i) {
    a.say(*arm, 1, incarnation(), 1.0);
    poll();
    incarnation();
    most = std::max(most, std::abs(last.torque_applied[0] - before));
    before = last.torque_applied[0];
  }
  EXPECT_NEAR(before, 1, 1e-12);
  EXPECT_LT(most, 1.0 / 200 * 10) << "share rises by 1/200 a step, the arm's own motion adds a little";
}

TEST(Silence, TheSceneSaysWhetherTheArmHoldsOrOnlyBrakes) {
  for (const char* safe : {"hold", "brake"}) {
    const auto n = node(23);
    const scene::Scene s =
        four_link({"gravity_mps2=[0, -9.81, 0]", std::string("dynamics.on_silence=") + safe});
    auto arm = made(dynamics::DynamicsService::make(*n, s, {.pace = scene::Pace::realtime}));
    wire::Subscription<wire::ArmState> states(*n);
    Commander a(*n);
    wire::ArmState state;
    auto now = Clock::now();
    for (int i = 0; i < 300; ++i) {
      while (states.take(state)) {
      }
      a.say(*arm, 1, state.incarnation, 3);
      arm->poll(now += 1ms);
    }
    EXPECT_GT(arm->arm().state().qd.lpNorm<Eigen::Infinity>(), 0.1) << safe;
    // Once nothing drives it, the arm only loses speed: it does not swing back to where it was told to stop.
    double before_J = scene::kInf, risen_J = 0;
    for (int i = 0; i < 1000; ++i) {
      arm->poll(now += 1ms);
      while (states.take(state)) {
      }
      if (state.validity != wire::Validity::command_stale) continue;
      const double kinetic_J = 0.5 * state.momentum.dot(state.velocity);
      risen_J = std::max(risen_J, kinetic_J - before_J);
      before_J = kinetic_J;
    }
    EXPECT_LT(risen_J, 1e-6) << safe << ": what is left below 0.02 rad/s may swing";
    const Eigen::VectorXd there = arm->arm().state().q;
    EXPECT_LT(arm->arm().state().qd.lpNorm<Eigen::Infinity>(), 1e-3) << safe;
    for (int i = 0; i < 1000; ++i) arm->poll(now += 1ms);
    EXPECT_LT((arm->arm().state().q - there).lpNorm<Eigen::Infinity>(), 1e-3) << safe << ": gravity is held";
  }
}

}  // namespace
