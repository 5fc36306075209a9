#pragma once
/// The arm in this cycle: poses, velocities, inertia.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "common/model/chain.h"
#include "common/rbd/rbd.h"

namespace hamel::planner {

/// Everything about the arm that one cycle needs, at one (q, qd).  Gravity is left out: another compensates
/// it.
struct Arm {
  explicit Arm(const model::Chain& chain);
  /// Poses and velocities alone: ws, X_WE, J_E, V_WE.  No allocation.
  void look(const Eigen::VectorXd& q_now, const Eigen::VectorXd& qd_now) noexcept;
  /// Everything.  No allocation.
  void update(const Eigen::VectorXd& q_now, const Eigen::VectorXd& qd_now) noexcept;
  int n() const noexcept { return chain.n(); }
  /// Angular velocity of a link, world axes.
  Eigen::Vector3d angular_velocity(int link) const noexcept;

  model::Chain chain;         ///< without gravity
  model::Chain with_gravity;  ///< as given
  rbd::Workspace ws;
  Eigen::VectorXd q, qd;
  std::vector<lie::Twist> Vdot_B;  ///< of the links at qdd = 0: rbd::bias_twists()
  Eigen::MatrixXd M, M_inverse;
  Eigen::LLT<Eigen::MatrixXd> M_llt;
  Eigen::VectorXd momentum;  ///< M qd
  Eigen::VectorXd coriolis;  ///< c(q, qd)
  Eigen::VectorXd gravity;   ///< torque that holds the arm, which another adds to ours
  lie::Pose X_WE;
  Eigen::MatrixXd J_E;  ///< 6 x n at the end effector: (omega, v), world axes
  lie::Twist V_WE = lie::Twist::Zero();
  double reach_m = 0;  ///< no configuration puts the end effector farther from the first joint
  Eigen::Vector3d shoulder_W = Eigen::Vector3d::Zero();  ///< where the first joint is
};

}  // namespace hamel::planner
