#pragma once
/// What draws the arm to its goal, Eq. (17), with the velocity saturation it needs; planner.md 1.1, 1.11.

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "common/scene/options.h"
#include "common/scene/scene.h"
#include "services/planner/core/arm.h"

namespace hamel::planner {

/// How far the goal is.
struct GoalError {
  double position_m = 0;  ///< joints: the largest difference [rad or m]
  double angle_rad = 0;   ///< pose goals
  double scaled = 0;      ///< largest error over its tolerance: within when <= 1
};

class Attraction {
 public:
  Attraction(const Arm& arm, const scene::PlannerOptions& options);

  /// Position and pose, in operational space (x: position, or orientation and position):
  ///   v_d = (kp/kv)(x_d - x), saturated at vmax * slow;   a = -kv (xdot - xdot_d - v_d);   tau = J^T Lam a.
  /// Joints: the same with q in place of x and M in place of Lam, v_d saturated by the tip's speed.
  /// @param slow  in [0, 1], scales v_d after saturation
  /// @param age_s how long the goal has been moving with its twist
  void update(const Arm& arm, const scene::Goal& goal, double age_s, double slow) noexcept;

  const Eigen::VectorXd& torque() const noexcept { return torque_; }
  /// M^-1 of what torque() would be at rest [rad/s^2 or m/s^2]: it asks for v_d and brakes nothing.
  const Eigen::VectorXd& drive() const noexcept { return drive_; }
  const GoalError& error() const noexcept { return error_; }
  /// kp/2 e^T Lam e, with the inertia along the wanted acceleration for Lam: energy of the pull [J].
  double potential_J() const noexcept { return potential_; }
  /// What the velocity term of the pull takes out of the arm: kv xdot^T Lam xdot [W], >= 0 without joint
  /// limits.
  double braking_W() const noexcept { return braking_; }
  /// Where the target is now, world (the tip where the goal is of joints).
  const Eigen::Vector3d& target_W() const noexcept { return X_WT_.p; }
  /// The same with the orientation that a pose goal asks for.
  const lie::Pose& target() const noexcept { return X_WT_; }
  /// A joint target lies outside the joint limits; the nearest one inside them.
  static bool beyond_limits(const Arm& arm, const scene::Goal& goal) noexcept;
  static void clamp_to_limits(const Arm& arm, scene::Goal& goal) noexcept;
  /// The joint that the attraction presses against its limit, or -1.
  int blocked_joint(const Arm& arm) const noexcept;

 private:
  void toward_pose(const Arm& arm, const scene::Goal& goal, double age_s, double slow) noexcept;
  void toward_joints(const Arm& arm, const scene::Goal& goal, double slow) noexcept;
  void map(const Arm& arm, Eigen::Index rows) noexcept;
  void map_with_limits(const Arm& arm, Eigen::Index rows) noexcept;
  void brake(const Arm& arm, Eigen::Index rows) noexcept;
  void operational_inertia(Eigen::Index rows, double scale) noexcept;

  const scene::PlannerOptions& options_;
  GoalError error_;
  double potential_ = 0, braking_ = 0;
  lie::Pose X_WT_;
  Eigen::Matrix<double, 6, 1> a_ =
      Eigen::Matrix<double, 6, 1>::Zero();  ///< angular part unused for positions
  Eigen::Matrix<double, 6, 6> Lam_inverse_ = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::LLT<Eigen::Matrix<double, 6, 6>> Lam_;
  Eigen::VectorXd torque_, qdd_, drive_;
  Eigen::MatrixXd WJ_;  ///< n x 6: W^-1 J^T
  Eigen::MatrixXd W_;
  Eigen::LLT<Eigen::MatrixXd> W_llt_;
};

}  // namespace hamel::planner
