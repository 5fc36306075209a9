#pragma once
/// The arm at one node of time with everything a step may ask of it.

#include <Eigen/Core>
#include <vector>

#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

using Eigen::VectorXd;
using LinkPoses = std::vector<rbd::LinkPose<double>>;
using JointFactors = std::vector<rbd::JointFactor<double>>;

/// Configuration, momentum and velocity with the mass matrix factorised there.  place() first, then one of
/// the others.  Assignments keep the sizes of the constructor: nothing allocates.
struct Node {
  explicit Node(const rbd::AxisChain& chain);

  /// Poses, factorisation of M(q) and potential energy at q.
  void place(const rbd::AxisChain& chain, const VectorXd& q_new) noexcept;
  /// qd = M^-1 p and the energy.
  void move_with_momentum(const rbd::AxisChain& chain, const VectorXd& p_new) noexcept;
  /// p = M qd and the energy.
  void move_with_velocity(const rbd::AxisChain& chain, const VectorXd& qd_new) noexcept;
  /// True when every number of the state is finite.
  bool finite() const noexcept;

  VectorXd q, p, qd;
  std::vector<double> history;  ///< the tier's own
  LinkPoses X;
  JointFactors factor;     ///< of M(q), armature included
  double potential_J = 0;  ///< U(q)
  double energy_J = 0;     ///< E = p . qd / 2 + U

 private:
  VectorXd scratch_;
  std::vector<rbd::Half6<double>> momentum_;
};

}  // namespace hamel::dynamics
