#pragma once
/// Whether any configuration meets a goal, and how near one can come.

#include "common/scene/options.h"
#include "common/scene/scene.h"
#include "services/planner/core/arm.h"

namespace hamel::planner {

struct Reachability {
  bool reachable = true;
  Eigen::Vector3d nearest_W = Eigen::Vector3d::Zero();  ///< position of the end effector that comes nearest
};

/// Damped inverse kinematics from 100 configurations within the joint limits, the same ones each time;
/// obstacles play no part.  Position and pose goals; goals of joints are reachable within their limits.
///
/// "Not reachable" is a search that failed, no proof; of 2,000 goals that are reachable by construction none
/// was refused (a test).  Takes 0.1 ms where it is, some milliseconds where it is not: for new goals, not for
/// cycles.  Allocates.
/// @param near  may be null; else a configuration the arm is close to: the search begins there and tries few
///              others, for targets that move on
Reachability reachability(const model::Chain& chain, const scene::Goal& goal,
                          const scene::PlannerOptions& options, const Eigen::VectorXd* near = nullptr);

/// A configuration that meets a position or pose goal, found by descent from `start`, each joint within half
/// a turn of it where its limits allow; empty where the descent ends elsewhere.  Obstacles play no part.
/// Allocates.
Eigen::VectorXd configuration_at(const model::Chain& chain, const scene::Goal& goal,
                                 const scene::PlannerOptions& options, const Eigen::VectorXd& start);

}  // namespace hamel::planner
