#pragma once
/// An open chain of rigid links as numbers: what every algorithm reads and none changes.
///
/// Every joint of a chain moves.  Fixed joints are lumped by the reader (files::load_urdf): what hangs behind
/// one counts in the inertia of the moving link that carries it.  A body in the hand is put on by
/// dynamics::Integrator::set_payload(), a wrench on any link by set_wrench() there, or rbd::add_wrench().

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/lie/se3.h"

namespace hamel::model {

enum class JointKind : std::uint8_t { revolute, continuous, prismatic };

/// Mass distribution of a link, in the axes of the link's frame.
struct Inertia {
  double mass_kg = 0;
  Eigen::Vector3d com_m = Eigen::Vector3d::Zero();           ///< centre of mass in the link frame
  Eigen::Matrix3d about_com_kgm2 = Eigen::Matrix3d::Zero();  ///< about the centre of mass
};

/// What a joint may do.  Unlimited unless said.
struct JointLimits {
  double lower = -std::numeric_limits<double>::infinity();        ///< [rad or m]
  double upper = std::numeric_limits<double>::infinity();         ///< [rad or m]
  double velocity = std::numeric_limits<double>::infinity();      ///< |qd| [rad/s or m/s]
  double acceleration = std::numeric_limits<double>::infinity();  ///< |qdd| [rad/s^2 or m/s^2]
  double effort = std::numeric_limits<double>::infinity();        ///< |tau| [N m or N]
};

/// A one-degree-of-freedom joint between link i-1 (P, or the base) and link i (B).
/// X_PB(q) = X_PJ exp(A q), A = (axis, 0) for revolute and (0, axis) for prismatic: Eq. (3).
struct Joint {
  std::string name;
  JointKind kind = JointKind::revolute;
  lie::Pose X_PJ;                                   ///< pose of link i's frame in link i-1's at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit, in link i's frame
  JointLimits limits;
  double damping = 0;   ///< viscous, tau = -damping qd [N m s/rad or N s/m]
  double armature = 0;  ///< rotor inertia about the joint [kg m^2 or kg]
};

/// A rigid link.  Its frame B sits on its joint.
struct Link {
  std::string name;
  Inertia inertia;
};

/// What a Chain is built from; freely editable, checked by build().
struct ChainSpec {
  std::string name;
  std::vector<Joint> joints;  ///< from base to tip
  std::vector<Link> links;    ///< as many as joints
  lie::Pose X_WB0;            ///< pose of the base in the world
  Eigen::Vector3d gravity_W_mps2 = {0, 0, -9.81};
  std::string tip_name;  ///< name of the end-effector frame
  lie::Pose X_NE;        ///< end-effector frame E in the last link's frame
};

/// An immutable, checked chain: indices run from 0 (next to the base) to n()-1 (tip).
class Chain {
 public:
  int n() const noexcept { return static_cast<int>(spec_.joints.size()); }
  const std::string& name() const noexcept { return spec_.name; }
  const Joint& joint(int i) const { return spec_.joints[static_cast<std::size_t>(i)]; }
  const Link& link(int i) const { return spec_.links[static_cast<std::size_t>(i)]; }
  const lie::Pose& X_WB0() const noexcept { return spec_.X_WB0; }
  const Eigen::Vector3d& gravity_W_mps2() const noexcept { return spec_.gravity_W_mps2; }
  const lie::Pose& X_NE() const noexcept { return spec_.X_NE; }
  /// Joint axis as a unit twist in link i's frame.  A_i of Eq. (3).
  const lie::Twist& A_B(int i) const { return A_B_[static_cast<std::size_t>(i)]; }
  /// The spec this chain was built from, for tools that make a variant of it.
  const ChainSpec& spec() const noexcept { return spec_; }

 private:
  friend Checked<Chain> build(ChainSpec);
  explicit Chain(ChainSpec spec);
  ChainSpec spec_;
  std::vector<lie::Twist> A_B_;
};

/// A checked chain, or every problem of the spec: sizes differ, no joint, axis not unit to 1e-9, rotation not
/// orthonormal to 1e-9, a number not finite, mass < 0, a moving mass whose inertia is not positive definite
/// or breaks the triangle inequality, no inertia at all on a moving link, limits crossed, damping or armature
/// < 0.
Checked<Chain> build(ChainSpec spec);

/// The chain without gravity.
Chain weightless(const Chain& chain);
/// How far a joint slides from q = 0, at most: max(|lower|, |upper|), +inf without limits.  0 where it turns.
double travel_m(const Joint& joint) noexcept;
/// True while every slide of the chain keeps to its travel.
bool slides_hold(const Chain& chain, const Eigen::VectorXd& q) noexcept;

}  // namespace hamel::model
