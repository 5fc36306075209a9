#pragma once
/// Whether any configuration meets a goal, and how near one can come.

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "common/scene/options.h"
#include "common/scene/scene.h"
#include "services/planner/core/arm.h"

namespace hamel::planner {

/// Everything the answer depends on, beside chain and options.
struct ReachQuestion {
  scene::Goal goal;
  /// Empty, or a configuration the arm is close to: the search begins there and tries few others, for targets
  /// that move on.
  Eigen::VectorXd near = {};
};

struct Reachability {
  bool reachable = true;
  Eigen::Vector3d nearest_W = Eigen::Vector3d::Zero();  ///< position of the end effector that comes nearest
};

/// Damped inverse kinematics from 100 configurations within the joint limits, the same ones each time;
/// obstacles play no part.  Position and pose goals; goals of joints are reachable within their limits.
///
/// "Not reachable" is a search that failed, no proof; of 2,000 goals that are reachable by construction none
/// was refused (a test).  Takes 0.1 ms where it is, some milliseconds where it is not, more on a longer arm:
/// never for the control thread.  Allocates.
/// @param stop  asked in each step of a search; once it says true the answer means nothing
Reachability reachability(const model::Chain& chain, const ReachQuestion& question,
                          const scene::PlannerOptions& options, const std::function<bool()>& stop = {});

/// How many goals this thread has searched for so far: a control thread's number stands still.
std::uint64_t goals_searched() noexcept;

/// A configuration that meets a position or pose goal, found by descent from `start`, each joint within half
/// a turn of it where its limits allow; empty where the descent ends elsewhere.  Obstacles play no part.
/// Allocates.
Eigen::VectorXd configuration_at(const model::Chain& chain, const scene::Goal& goal,
                                 const scene::PlannerOptions& options, const Eigen::VectorXd& start);

}  // namespace hamel::planner
