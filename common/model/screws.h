#pragma once
/// A chain from the screws of a product of exponentials.

#include "common/model/chain.h"

namespace hamel::model {

/// One joint and its link, seen from the base while every joint is at zero.
struct Screw {
  std::string name;
  JointKind kind = JointKind::revolute;
  /// Joint axis as a twist (omega, v) in the base's frame: (omega, -omega x r) for a revolute joint about the
  /// unit vector omega through r, (0, v) for a prismatic one along the unit vector v.
  lie::Twist S_B0 = lie::Twist::Zero();
  lie::Pose X_B0L;  ///< pose of the frame in which `inertia` is given, in the base's
  Inertia inertia;
  JointLimits limits;
  double damping = 0, armature = 0;  ///< as Joint's
};

/// A product of exponentials: X_B0E(q) = exp(S_1 q_1) ... exp(S_n q_n) X_B0E(0), Eqs. (3), (4) gathered at
/// the base.
struct ScrewSpec {
  std::string name;
  std::vector<Screw> joints;  ///< from base to tip
  lie::Pose X_B0E;            ///< end effector at q = 0, in the base's frame
  lie::Pose X_WB0;            ///< pose of the base in the world
  Eigen::Vector3d gravity_W_mps2 = {0, 0, -9.81};
};

/// The chain frame by frame: link i's frame has the axes of X_B0L and sits on the joint's axis, at the point
/// of it nearest to X_B0L's origin (a prismatic joint: at that origin).  Else every problem: omega or v not
/// of unit length, pitch (omega . v) not 0, and whatever build() finds.
Checked<Chain> build(const ScrewSpec& spec);

}  // namespace hamel::model
