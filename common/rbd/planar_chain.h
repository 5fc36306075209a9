#pragma once
/// A chain that moves in one plane, as the recursions on SE(2) read it.
///
/// At q = 0 every link's frame is parallel to the plane's axes e_1, e_2; e_3 is the first revolute axis. What
/// lies across the plane does no work there: gravity's share becomes a constant of the potential energy.

#include <optional>
#include <vector>

#include "common/lie/vec2.h"
#include "common/rbd/axis_chain.h"

namespace hamel::rbd {

/// Constants of one joint and its link in the plane.
struct PlanarLink : JointNumbers {
  lie::Vec2<double> p_PJ;  ///< origin in the parent's frame at q = 0 [m]
  lie::Vec2<double> h;     ///< mass times centre of mass [kg m]
  lie::Vec2<double> axis;  ///< unit direction of a prismatic joint
  double I_o = 0;          ///< rotational inertia about the frame's origin [kg m^2]
  double sign = 1;         ///< of a revolute joint's axis on e_3
};

struct PlanarChain {
  /// `chain` must be planar.
  explicit PlanarChain(const model::Chain& chain);
  /// The same again for a chain of as many joints, planar too.  Allocates nothing.
  void assign(const model::Chain& chain) noexcept;
  std::vector<PlanarLink> links;
  Eigen::Matrix3d R_WE = Eigen::Matrix3d::Identity();  ///< the plane's axes e_1, e_2, e_3
  lie::Vec2<double> gravity_W;                         ///< along e_1, e_2 [m/s^2]
  double energy_scale = 0;                             ///< weight times reach of the whole arm [J]
  double potential_offset = 0;                         ///< of gravity across the plane [J]
  int n() const noexcept { return static_cast<int>(links.size()); }
  [[gnu::always_inline]] const PlanarLink& operator[](int i) const noexcept {
    return links[static_cast<std::size_t>(i)];
  }

 private:
  AxisChain axis_;  ///< where numbers that do not depend on frames come from
};

/// True when all revolute axes, one at least, are parallel to rounding and all prismatic ones perpendicular
/// to them.
bool is_planar(const model::Chain& chain) noexcept;

}  // namespace hamel::rbd
