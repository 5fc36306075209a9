#pragma once
/// An independent judge of contact: the full shapes of a robot against obstacles, distances by FCL.

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/geometry/shape.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// A touch and who caused it.
struct Contact {
  double t_s = 0;
  std::string who;          ///< "link panda_link5" or "base"
  std::uint32_t other = 0;  ///< obstacle id, or for a touch of two links the other shape's link
  bool self = false;
  /// The point of the arm that touches moved toward the obstacle faster than 0.02 m/s within the last 0.1 s;
  /// between two links always; never with what was never there before: a recording may begin with
  /// somebody where the arm is.
  bool arm_caused = false;
};

/// Follows one run step by step.
///
/// Between two states the arm goes on the straight line in joint space, obstacles on the straight line of
/// their centres; the line is sampled so that no point moves by more than 1 mm against any other between two
/// samples.  A pair whose last distance exceeds what can have been travelled since is passed over (bounds of
/// the travel: sum of |dq_j| times the reach of what joint j carries), so the minimum distance found is at
/// most 1 mm or 10 % above the true one.
///
/// Shapes are those of the robot as they are (sphere, capsule, cylinder, box), not what a planner makes of
/// them. The base is looked at against what moves only.  Half-spaces stand as boxes of 100 m.  Not for two
/// threads at once.
class Judge {
 public:
  /// Shapes of robot.self_pairs must not touch each other either.
  explicit Judge(const scene::Robot& robot);
  ~Judge();
  Judge(Judge&&) noexcept;

  /// Smallest distance of the arm standing at q to the obstacles; <= 0: touches.
  double clearance(const Eigen::VectorXd& q, std::span<const geometry::Obstacle> obstacles);
  /// Smallest distance of the shapes that must not touch each other; +inf: there are none.
  double self_clearance(const Eigen::VectorXd& q);
  /// clearance() for one link alone (-1: the base).
  double clearance_of_link(int link, const Eigen::VectorXd& q, std::span<const geometry::Obstacle> obstacles);

  /// The run goes on to this state; the first call sets where it begins.  Obstacles are told apart by id and
  /// may come and go.  @return the first touch on the way here, or null
  const Contact* advance(double t_s, const Eigen::VectorXd& q, std::span<const geometry::Obstacle> obstacles);
  /// Smallest distance so far, as far as it was looked for.
  double clearance_min_m() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hamel::client
