#pragma once
/// Closest points of two solids, whatever their shapes: what a link is, against what is in its way.

#include "common/geometry/distance.h"

namespace hamel::geometry {

/// A shape placed somewhere, with what its distances need prepared.
struct Solid {
  Shape shape;
  lie::Pose X;         ///< shape frame in the frame the solid is seen from
  bool round = true;   ///< a sphere or capsule: `capsule` is all of it
  Capsule capsule;     ///< round solids: in the same frame as X
  double bound_m = 0;  ///< nothing of it is farther from X.p; inf: half-space
};

/// A shape at X_AS, seen from frame A.
Solid solid(const Shape& shape, const lie::Pose& X_AS) noexcept;
/// The same solid seen from frame A.
Solid operator*(const lie::Pose& X_AB, const Solid& solid_B) noexcept;

/// Closest points of a link's solid and an obstacle's, both in the world; the shapes as they are, no
/// enclosing ones.
///
/// Round links, round obstacles, half-spaces: closed forms, see distance.h.  Box or cylinder against box or
/// cylinder: Gilbert-Johnson-Keerthi to 1e-12 relative; penetrating, the depth is the least of the separating
/// axes of the two (exact for boxes) refined on the sphere of directions: never less than the true one by
/// more than rounding.  A link that is a half-space has no distance: +inf.  No allocation, no throw.
Closest closest(const Solid& link_W, const Solid& obstacle_W) noexcept;

/// A lower bound of closest().distance_m from bounding spheres.
inline double distance_bound(const Solid& a_W, const Solid& b_W) noexcept {
  if (b_W.shape.kind == ShapeKind::half_space) return b_W.X.R.col(2).dot(a_W.X.p - b_W.X.p) - a_W.bound_m;
  return (a_W.X.p - b_W.X.p).norm() - a_W.bound_m - b_W.bound_m;
}

}  // namespace hamel::geometry
