// Ways out: rollouts find them, the same question gives the same answer, and where there is none the arm says
// so.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/support/planner_scene.h"

namespace hamel::test {
namespace {

using planner::Escape;
using planner::EscapeQuestion;
using planner::Reason;
using planner::State;

// Example 5.2 without circulation: barrier and attraction hold each other.
Example52 trapped() {
  Example52 e;
  e.options.method = scene::Method::gyro;
  e.options.kobs = 0;
  e.options.kc = 0;
  e.options.damping = 2;
  e.options.vmax_mps = 1;
  return e;
}

// Nine spheres about the target, open toward the arm's base only.
std::vector<geometry::Obstacle> pocket() {
  std::vector<geometry::Obstacle> wall;
  for (std::uint32_t k = 0; k < 9; ++k) {
    const double angle = -M_PI / 2 + M_PI * k / 8;
    wall.push_back(sphere(k + 1, {2 + 0.7 * std::cos(angle), 0.7 * std::sin(angle), 0}, 0.2));
  }
  return wall;
}

TEST(Escape, LeadsOutOfALocalMinimum) {
  Example52 e = trapped();
  e.options.escapes = 0;
  const RunResult without = run(e.robot, e.obstacles, e.options, e.goal, e.q0, 2e-3, 20);
  EXPECT_EQ(without.last.state, State::stuck);
  EXPECT_EQ(without.last.reason, Reason::local_minimum);
  e.options.escapes = 4;
  const RunResult with = run(e.robot, e.obstacles, e.options, e.goal, e.q0, 2e-3, 20);
  EXPECT_EQ(with.last.state, State::reached);
  EXPECT_GT(with.escapes, 0);
  EXPECT_LT(with.stuck_at_s, 0);  // an arm that lags asks before it is stuck
  EXPECT_EQ(with.contact_at_s, -1);
}

TEST(Escape, SameQuestionSameAnswer) {
  Example52 e = trapped();
  e.options.escape_rollouts = 64;
  EscapeQuestion question{7, e.q0, Eigen::VectorXd::Zero(4), e.obstacles, 0, e.goal, 0, 1};
  const Escape a = find_escape(e.robot, e.options, question), b = find_escape(e.robot, e.options, question);
  ASSERT_TRUE(a.found);
  EXPECT_EQ(a.rollouts, b.rollouts);
  EXPECT_EQ(std::memcmp(a.waypoint.data(), b.waypoint.data(), 4 * sizeof(double)), 0);
  question.step = 8;
  EXPECT_NE(find_escape(e.robot, e.options, question).waypoint, a.waypoint);
}

TEST(Escape, PocketEndsStuckWithoutContact) {
  Example52 e = trapped();
  e.options.kc = 2;
  e.options.kobs = 1;
  e.robot = planar_arm(4, 1.0 / 12, 0.05);
  e.goal.X_WG.p = {3.3, 0, 0};  // behind the pocket's wall
  e.q0 << 2.2, -3.2, 1.0, 0.0;  // folded, the tip in the pocket
  for (const int escapes : {0, 4}) {
    e.options.escapes = escapes;
    Reason said = Reason::none;
    int changes = 0;  // of the reason while stuck
    const RunResult r = run(e.robot, pocket(), e.options, e.goal, e.q0, 2e-3, 25, [&](const RunResult& now) {
      const Reason reason = now.last.state == State::stuck ? now.last.reason : Reason::none;
      changes += said != Reason::none && reason != Reason::none && reason != said;
      said = reason;
      return false;
    });
    EXPECT_EQ(changes, 0);
    EXPECT_EQ(r.contact_at_s, -1);
    if (r.last.state == State::reached) continue;
    EXPECT_EQ(r.last.state, State::stuck) << planner::to_string(r.last.reason);
    EXPECT_NE(r.last.reason, Reason::none);
    EXPECT_LT(r.stuck_at_s, 10);
  }
}

}  // namespace
}  // namespace hamel::test
