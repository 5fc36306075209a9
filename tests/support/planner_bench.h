#pragma once
/// One cycle of a planner, or a run, from one state that a test may bend.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/planner_scene.h"

namespace hamel::test {

/// A planar arm bent to the left, its tip near (2, 2), one obstacle far away.
struct PlannerBench {
  scene::Robot robot = planar_arm(4, 1.0 / 12, 0.05);
  scene::PlannerOptions options;
  std::vector<geometry::Obstacle> obstacles{sphere(1, {-3, 0, 0}, 0.2)};
  Eigen::VectorXd q = Eigen::Vector4d(0, M_PI / 2, 0, -M_PI / 4), qd = Eigen::VectorXd::Zero(4);
  scene::Goal goal;
  double obstacle_age_s = 0, state_age_s = 0, t_s = 0, dt_s = 1e-3;
  bool expected = false;

  PlannerBench() {
    options.barrier_gain = 12;
    goal.id = 1;
    goal.X_WG.p = {1, 2.5, 0};
  }
  planner::Input input() const {
    return {.step = 0,
            .t_s = t_s,
            .dt_s = dt_s,
            .q = q,
            .qd = qd,
            .obstacles = obstacles,
            .obstacle_age_s = obstacle_age_s,
            .state_age_s = state_age_s,
            .obstacles_expected = expected};
  }
  planner::Output plan(bool with_goal = true) const {
    planner::Planner p(robot, options);
    if (with_goal) p.set_goal(goal);
    planner::Output out = p.output();
    p.plan(input(), out);
    return out;
  }
  RunResult go(double duration_s) const { return run(robot, obstacles, options, goal, q, dt_s, duration_s); }
};

/// What a cycle said, and that it said it in words.
inline void expect(const planner::Output& out, planner::State state, planner::Reason reason) {
  EXPECT_EQ(out.report.state, state) << planner::to_string(out.report.state);
  EXPECT_EQ(out.report.reason, reason) << planner::to_string(out.report.reason);
  EXPECT_NE(std::string(out.report.detail), "");
}

}  // namespace hamel::test
