#pragma once
/// A way out for an arm that is stuck: the planner itself, run ahead on the arm's own model by way of one
/// waypoint after another, until one run ends at the goal.
///
/// Pure: the same question gives the same answer, whichever thread asks and whenever.  Allocates and takes
/// tens of milliseconds: never for the control thread.

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "services/planner/core/planner.h"

namespace hamel::planner {

/// Everything the answer depends on, beside robot and options.
struct EscapeQuestion {
  std::uint64_t step = 0;  ///< of the arm state; also the seed of the waypoints
  Eigen::VectorXd q, qd;
  std::vector<geometry::Obstacle> obstacles;  ///< where they are now; they go on with their velocities
  double obstacle_age_s = 0;
  scene::Goal goal;
  double goal_age_s = 0;  ///< how long the goal has been moving with its twist
  std::uint64_t tries = 0;
  bool stuck = true;  ///< false: the arm still moves, and may be on its way
};

/// By way of a configuration, or not at all.
struct Escape {
  bool found = false;
  Eigen::VectorXd waypoint;    ///< n
  int rollouts = 0;            ///< runs it took
  double reached_after_s = 0;  ///< of the run chosen
};

/// Rolls out `options.escape_rollouts` random waypoints, every other one a posture at the goal itself,
/// `escape_horizon_s` each, at 10 ms a cycle; of the
/// runs that reach the goal without contact the quickest wins.  None does: not found.  An arm that is not
/// stuck and reaches its goal as it goes needs none: not found either.
/// @param stop  asked in each cycle of a rollout; once it says true the answer is: not found
Escape find_escape(const scene::Robot& robot, const Options& options, const EscapeQuestion& question,
                   const std::function<bool()>& stop = {});

}  // namespace hamel::planner
