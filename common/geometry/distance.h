#pragma once
/// Closest points between a link and an obstacle: signed distance, witnesses, normal, and how the obstacle
/// bends there.
///
/// Here a link is a capsule; solid.h has the other shapes.  The signed distance is
///   d = min over the points x of the capsule's axis of (signed distance of x to the obstacle) - radius,
/// the exact separation where d >= 0, and minus the depth of the deepest axis point (plus radius) where it is
/// not. Exact in finitely many operations against spheres, capsules, boxes and half-spaces; against cylinders
/// the point on the axis comes from 60 bisections of a monotone derivative, which ends at rounding.

#include <Eigen/Core>
#include <limits>

#include "common/geometry/shape.h"
#include "common/lie/se3.h"

namespace hamel::geometry {

/// Every point within `radius_m` of the segment p0 p1.
struct Capsule {
  Eigen::Vector3d p0 = Eigen::Vector3d::Zero(), p1 = Eigen::Vector3d::Zero();
  double radius_m = 0;
  /// How far the capsule reaches beyond the shape it encloses, at most: 0 for spheres and capsules.
  double excess_m = 0;
};

/// The capsule around a link shape, in the shape's frame.  Outward: a cylinder gains round ends, a box the
/// circle about its smaller faces and round ends.  Half-spaces enclose nothing a link could be and come back
/// as a point.
Capsule enclosing_capsule(const Shape& shape) noexcept;

/// The same capsule seen from frame A.
Capsule operator*(const lie::Pose& X_AB, const Capsule& capsule_B) noexcept;

/// Result of closest(); world frame.
struct Closest {
  double distance_m = std::numeric_limits<double>::infinity();  ///< signed; < 0: penetration
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();            ///< unit, from the link toward the obstacle
  Eigen::Vector3d on_axis = Eigen::Vector3d::Zero();      ///< x_a, the axis point nearest to the obstacle
  Eigen::Vector3d on_link = Eigen::Vector3d::Zero();      ///< x_a + radius n
  Eigen::Vector3d on_obstacle = Eigen::Vector3d::Zero();  ///< x_a + (radius + d) n
  bool degenerate = false;  ///< the axis meets the obstacle's centre or axis: the normal is a convention

  // How the two slide on each other, for second derivatives of the distance.
  bool slides_on_link = false;                          ///< x_a is no end of the axis
  Eigen::Vector3d link_axis = Eigen::Vector3d::Zero();  ///< unit; zero for a point
  Eigen::Vector3d obstacle_axis =
      Eigen::Vector3d::Zero();  ///< unit, where the obstacle is straight; else zero
  /// Second directions, unit, where the link or the obstacle is flat: a face; else zero.
  Eigen::Vector3d link_axis2 = Eigen::Vector3d::Zero(), obstacle_axis2 = Eigen::Vector3d::Zero();
  double centre_m =
      std::numeric_limits<double>::infinity();  ///< from x_a to the centre of curvature; inf: flat
};

/// Closest points of a link's capsule and an obstacle's shape at X_WO.
///
/// Ties (parallel segments, a segment parallel to a face) take the middle of the tie.  Where the normal is
/// not determined (|x_a - centre| < 1e-9 m) it is the world axis least aligned with the link, made
/// perpendicular to it. Numbers must be finite.  No allocation, no throw.
Closest closest(const Capsule& link_W, const Shape& obstacle, const lie::Pose& X_WO) noexcept;

/// A lower bound of closest().distance_m from bounding spheres, in a few operations.
double distance_bound(const Capsule& link_W, const Shape& obstacle, const lie::Pose& X_WO) noexcept;

/// The world axis least aligned with u, made perpendicular to it (u unit, or zero: then x).
Eigen::Vector3d least_aligned(const Eigen::Vector3d& u) noexcept;

}  // namespace hamel::geometry
