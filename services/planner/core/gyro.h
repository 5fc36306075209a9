#pragma once
/// The gyroscopic terms of all pairs: which way to turn, and the joint torques of it;
/// planner.md 1.3-1.6, 1.8.

#include <Eigen/Core>
#include <Eigen/LU>

#include "common/scene/options.h"
#include "services/planner/core/arm.h"
#include "services/planner/core/memory.h"
#include "services/planner/core/pairs.h"

namespace hamel::planner {

class Gyro {
 public:
  Gyro(const Arm& arm, const scene::PlannerOptions& options);

  /// Every pair's normal (held where geometry leaves it open) and turning axis.
  /// @param qdd_att  M^-1 tau_att: where the attraction wants the points to go
  void choose_axes(Pairs& pairs, const Memory& memory, double t_s, const Eigen::VectorXd& qdd_att) noexcept;

  /// tau += the gyroscopic torque, and each pair's `gyroscopic` is the force [N] it was made of.
  ///   paper:             J^T Lam (w x v), Eq. (21)
  ///   force, symmetric:  sum J^T (w' x (J (qd + dqd/2) - v_o)), with G = sum J^T hat(w') J, skew, and dqd
  ///   from
  ///                      (M - dt/2 G) dqd = dt (tau - c + G qd - sum J^T (w' x v_o)): powerless over the
  ///                      step for who moves with the obstacle
  void add(const Arm& arm, Pairs& pairs, double dt_s, Eigen::VectorXd& tau) noexcept;

  /// tau += J^T Lam (kc S(1 - d/rho0) press e_c x n), press = max(0, min(n . J qdd_att, 3/2 n . J qdd_rest)):
  /// slides along what it presses on, in the direction held for that obstacle.  planner.md 1.8.  True where
  /// some pair pressed.
  /// @param qdd_rest  what qdd_att would be at rest.  Without it a point that leaves an obstacle, and is
  ///                  braked for that, would press on it the more the faster it goes: circulation fed on its
  ///                  own speed, up to 25 m/s where vmax was 1.
  bool add_circulation(Pairs& pairs, Memory& memory, double t_s, double kc, const Eigen::VectorXd& qdd_att,
                       const Eigen::VectorXd& qdd_rest, Eigen::VectorXd& tau) noexcept;

  double gyroscopic_power_W() const noexcept { return gyroscopic_power_; }
  /// By moving obstacles and circulation.
  double injected_power_W() const noexcept { return injected_power_; }
  double circulation_power_W() const noexcept { return circulation_power_; }
  void clear_power() noexcept { gyroscopic_power_ = injected_power_ = circulation_power_ = 0; }

 private:
  Eigen::Vector3d preferred_axis(const Pair& pair, const Eigen::Vector3d& g,
                                 const HeldPair* held) const noexcept;
  Eigen::Vector3d rotation(const Pair& pair) const noexcept;
  void add_paper(const Arm& arm, Pairs& pairs, Eigen::VectorXd& tau) noexcept;
  void add_powerless(const Arm& arm, Pairs& pairs, double dt_s, Eigen::VectorXd& tau) noexcept;

  const scene::PlannerOptions& options_;
  bool improved_;  ///< method gyro: form S, tie-break, symmetric, relative velocity
  scene::Mapping mapping_;
  Eigen::Vector3d plane_axis_;  ///< the common axis of a planar arm, world; zero: spatial
  Eigen::MatrixXd G_, M_minus_;
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
  Eigen::VectorXd dqd_, v_mid_, tau_gyro_, tau_moving_;
  double gyroscopic_power_ = 0, injected_power_ = 0, circulation_power_ = 0;
};

/// The common direction of all joint axes in the world where a chain is planar (revolute, all parallel); else
/// zero.
Eigen::Vector3d plane_axis(const model::Chain& chain) noexcept;

}  // namespace hamel::planner
