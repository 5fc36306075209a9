/// What `hamel up` reports of a run where another network on the domain has an arm of the same number.  In
/// process, the test gives the time.

#include "clients/hamel/monitor.h"

#include <gtest/gtest.h>

#include "tests/support/services.h"

namespace hamel {
namespace {

using client::Monitor;
using runtime::Clock;
using namespace std::chrono_literals;

/// Everything one network says about its arm 1.
struct Network {
  Network(bus::Node& n, std::uint64_t made, std::uint64_t first_step)
      : state(n), report(n), summary(n), incarnation(made), step(first_step) {}

  void speak(bool stale, bool blind) {
    ++step;
    wire::ArmState s = test::arm_state(step, wire::JointVector::Zero(4), 1, incarnation);
    s.validity = stale ? wire::Validity::command_stale : wire::Validity::valid;
    state.publish(s);
    wire::PlannerReport r;
    r.arm = 1, r.epoch = incarnation, r.step = step, r.t_s = s.t_s;
    r.state = blind ? wire::PlannerState::unsafe : wire::PlannerState::moving;
    r.reason = blind ? wire::Reason::stale_obstacles : wire::Reason::none;
    report.publish(r);
  }
  void end(std::uint64_t of) {
    wire::RunSummary s;
    s.arm = 1, s.incarnation = of, s.steps = step, s.final_summary = true, s.outcome = "done";
    summary.publish(s);
  }

  wire::Publisher<wire::ArmState> state;
  wire::Publisher<wire::PlannerReport> report;
  wire::Publisher<wire::RunSummary> summary;
  std::uint64_t incarnation, step;
};

class Monitored : public testing::Test {
 protected:
  /// Both speak once a millisecond; ours without commands and sight from its steps 101 to 200, the other's
  /// always.
  void run(int steps, bool both = true) {
    for (int i = 0; i < steps; ++i) {
      const bool out = ours.step >= 100 && ours.step < 200;
      if (both) other.speak(true, true);
      ours.speak(out, out);
      monitor.poll(now += 1ms);
    }
  }
  Clock::time_point now = Clock::now();
  std::unique_ptr<bus::Node> n = test::node(22);
  scene::Scene scene = test::four_link();
  Monitor monitor{*n, scene, scene::Pace::realtime, nullptr, false};
  Network ours{*n, 7, 0}, other{*n, 8, 50000};
};

TEST_F(Monitored, OutagesAreOurs) {
  run(50, false);
  run(250);
  const client::Outcome o = monitor.outcome(false);
  ASSERT_EQ(o.outages.size(), 2U);
  for (const auto& outage : o.outages) {
    EXPECT_NEAR(outage.length_s, 0.1, 1e-9) << outage.service;
    EXPECT_NEAR(outage.t_s, 0.101, 1e-9) << outage.service;
  }
  EXPECT_NEAR(o.t_s, 0.3, 1e-9);
  EXPECT_EQ(o.rows_lost, 0U);
}

TEST_F(Monitored, ItEndsWithOurArm) {
  run(50, false);
  other.end(other.incarnation);
  run(1);
  now += 1s;
  run(1);
  EXPECT_FALSE(monitor.finished());
  ours.end(ours.incarnation);
  run(1);
  now += 1s;
  run(1);
  EXPECT_TRUE(monitor.finished());
}

/// A killed arm goes on where it was, from another writer; one that lost its memory is another incarnation.
TEST_F(Monitored, AnArmThatComesBackIsFollowed) {
  run(50, false);
  Network again(*n, ours.incarnation, ours.step);
  now += 70ms;
  again.speak(false, false);
  monitor.poll(now += 1ms);
  EXPECT_NEAR(monitor.outcome(false).t_s, 0.051, 1e-9);
  ASSERT_EQ(monitor.outcome(false).outages.size(), 1U);
  EXPECT_NEAR(monitor.outcome(false).outages[0].length_s, 0.071, 1e-9);
  Network anew(*n, 9, 10);
  anew.speak(true, false);
  monitor.poll(now += 1ms);
  EXPECT_NEAR(monitor.outcome(false).t_s, 0.051, 1e-9) << "not yet";
  now += 300ms;
  for (int i = 0; i < 2; ++i) {
    anew.speak(false, false);
    monitor.poll(now += 1ms);
  }
  EXPECT_NEAR(monitor.outcome(false).t_s, 0.013, 1e-9);
  for (const auto& outage : monitor.outcome(false).outages) EXPECT_GE(outage.length_s, 0) << outage.service;
}

}  // namespace
}  // namespace hamel
