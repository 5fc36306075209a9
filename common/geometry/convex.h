#pragma once
/// Distance and depth of two convex solids from their support functions alone.

#include <Eigen/Core>

#include "common/geometry/shape.h"
#include "common/lie/se3.h"

namespace hamel::geometry {

/// The farthest point of a box or cylinder along n (not zero), in its own frame; spheres and capsules too.
Eigen::Vector3d support(const Shape& s, const Eigen::Vector3d& n) noexcept;
/// The same, and the middle where a whole edge or face is farthest.
Eigen::Vector3d support_middle(const Shape& s, const Eigen::Vector3d& n) noexcept;

/// How two solids stand apart; < 0: the depth.
struct Separation {
  double distance_m = 0;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, from a toward b
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

/// Separation of two bounded solids.  Apart: Gilbert-Johnson-Keerthi, relative 1e-12.  Together: the least
/// overlap over the separating axes of the two, refined; see solid.h.  [Gilbert 1988]
Separation separation(const Shape& a, const lie::Pose& X_Wa, const Shape& b, const lie::Pose& X_Wb) noexcept;

/// v to length 1, or zero where it has none.
Eigen::Vector3d unit_or_zero(const Eigen::Vector3d& v) noexcept;

}  // namespace hamel::geometry
