#pragma once
/// The barrier of last resort: of all accelerations that keep their distance, the one nearest to what was
/// wanted, in the metric of the mass matrix (Gauss's least constraint); planner.md 1.7.

#include <Eigen/Core>

#include "common/scene/options.h"
#include "services/planner/core/arm.h"
#include "services/planner/core/least_norm.h"
#include "services/planner/core/pairs.h"

namespace hamel::planner {

/// d2/dt2 of the distance that comes from sliding and turning alone: no acceleration in it.  The distance is
/// the least over positions s on the link's axis and t on the obstacle's; with F(s, t, time) = |y - x|
///   curvature = F_tautau - m^T H^-1 m,  m = (F_s,tau, F_t,tau), H the Hessian in those of s, t that slide.
/// Sliding goes no farther than the two are long in `within_s`: nearly parallel lines would otherwise slide
/// without bound, and the derivative with them.
/// @param within_s  > 0: how far ahead the distance matters
double distance_curvature(const Pair& pair, const Eigen::Vector3d& omega_link, double within_s) noexcept;

class Barrier {
 public:
  Barrier(const Arm& arm, const scene::PlannerOptions& options);

  struct Outcome {
    int rows = 0;
    bool active = false;        ///< some row pushed
    bool infeasible = false;    ///< a pair or a joint limit is missed by more than it can afford
    bool torque_bound = false;  ///< a torque limit pushed
  };
  /// min 1/2 (a - a0)^T M (a - a0) + the price of what is missed, subject to, with g the barrier gain (at
  /// most 1/4 over dt),
  ///   pairs:         hdd + 2 g hd + g^2 h >= 0,  h = d - dmin
  ///   joint limits:  the same with the distance to each limit near enough
  ///   |qd|, |qdd|, |M a + c + gravity| within the robot's limits of velocity, acceleration and torque
  /// by an active-set method in x = L^T (a - a0), M = L L^T.  Rows that contradict each other share the miss
  /// by their price: what is physical (torque, joint limits) before distance, distance before what a
  /// controller asks for (velocity, acceleration).
  /// No |a_j| comes out beyond kMostOver times the joint's limit: more is cut off, and infeasible.
  static constexpr double kMostOver = 5;
  /// @param a  in: a0, out: the minimiser
  Outcome solve(const Arm& arm, Pairs& pairs, double dt_s, Eigen::VectorXd& a) noexcept;
  /// The same with the torque limits alone: for an arm that brakes whatever stands about it.
  void keep_torque(const Arm& arm, Eigen::VectorXd& a) noexcept;

 private:
  void add_row(double b, double price) noexcept;
  void add_pair_rows(const Arm& arm, Pairs& pairs) noexcept;
  void add_joint_rows(const Arm& arm, double dt_s) noexcept;
  double acceleration_limit(const Arm& arm, int j) const noexcept;
  void add_torque_rows(const Arm& arm) noexcept;
  bool settle(const Arm& arm, Eigen::VectorXd& a) noexcept;

  const scene::PlannerOptions& options_;
  LeastNorm least_norm_;
  Eigen::MatrixXd A_, C_;      ///< a row's coefficients as a column; L^-1 times it, to length 1
  Eigen::MatrixXd L_inverse_;  ///< M = L L^T
  Eigen::VectorXd b_, s_, length_, give_, x_;
  std::vector<std::size_t> pair_of_row_;
  double gain_ = 0;  ///< of this cycle [1/s]
  Eigen::Index rows_ = 0, hard_rows_ = 0, torque_row_ = 0;
};

}  // namespace hamel::planner
