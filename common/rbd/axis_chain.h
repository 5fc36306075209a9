#pragma once
/// The chain as the recursions read it: each link's frame turned so that its joint axis is the third axis.
///
/// Then A_i = e_3 (revolute) or e_6 (prismatic), A_i^T F picks one number and I_i A_i one column.  Joint
/// values, torques and energies do not notice; only link-frame quantities would, and those stay in rbd.h's
/// link frames.

#include <vector>

#include "common/lie/vec3.h"
#include "common/model/chain.h"

namespace hamel::rbd {

/// Constants of one joint and its link that do not depend on frames.
struct JointNumbers {
  double mass = 0;              ///< [kg]
  double damping = 0;           ///< [N m s/rad or N s/m]
  double armature = 0;          ///< [kg m^2 or kg]
  double outer_mass = 0;        ///< of this link and all beyond it [kg]
  double weight = 0;            ///< bound of |gravity torque| at this joint [N m or N]
  double moment_size = 0;       ///< sum of |mass times centre of mass| by components [kg m]
  double inertia_size = 0;      ///< largest moment of inertia about the frame's axes [kg m^2]
  double lower = 0, upper = 0;  ///< joint limits, +-infinity where there are none
  bool prismatic = false;
};

/// Constants of one joint and its link in space.
struct AxisLink : JointNumbers {
  lie::Mat3<double> R_PJ;  ///< rotation of the frame in its parent's at q = 0
  lie::Vec3<double> p_PJ;  ///< its origin there [m]
  lie::Vec3<double> h;     ///< mass times centre of mass [kg m]
  lie::Sym3<double> I_o;   ///< rotational inertia about the frame's origin [kg m^2]
};

struct AxisChain {
  explicit AxisChain(const model::Chain& chain);
  /// The same again for a chain of as many joints.  Allocates nothing.
  void assign(const model::Chain& chain) noexcept;
  std::vector<AxisLink> links;
  lie::Vec3<double> gravity_W;  ///< [m/s^2]
  double energy_scale = 0;      ///< weight times reach of the whole arm [J]
  double potential_offset = 0;  ///< [J], what the recursions leave out of the potential energy
  int n() const noexcept { return static_cast<int>(links.size()); }
  [[gnu::always_inline]] const AxisLink& operator[](int i) const noexcept {
    return links[static_cast<std::size_t>(i)];
  }
};

/// A rotation whose third column is the unit vector `axis`; the identity where the axis is e_3 already, so
/// that robots modelled about z keep their digits.
Eigen::Matrix3d frame_about(const Eigen::Vector3d& axis);

}  // namespace hamel::rbd
