#pragma once
/// Shapes and poses as FCL, the independent judge of distances, sees them.

#include <fcl/narrowphase/collision.h>

#include <Eigen/Geometry>
#include <memory>

#include "common/geometry/shape.h"

namespace hamel::client {

using FclSolid = std::shared_ptr<fcl::CollisionGeometryd>;

/// Edge of the box that stands for a half-space; its upper face is the plane.
inline constexpr double kHalfSpace_m = 100;

inline FclSolid fcl_solid(const geometry::Shape& s) {
  const Eigen::Vector3d& d = s.dims_m;
  switch (s.kind) {
    case geometry::ShapeKind::sphere:
      return std::make_shared<fcl::Sphered>(d[0]);
    case geometry::ShapeKind::capsule:
      return std::make_shared<fcl::Capsuled>(d[0], d[1]);
    case geometry::ShapeKind::cylinder:
      return std::make_shared<fcl::Cylinderd>(d[0], d[1]);
    case geometry::ShapeKind::box:
      return std::make_shared<fcl::Boxd>(d[0], d[1], d[2]);
    case geometry::ShapeKind::half_space:
      break;
  }
  return std::make_shared<fcl::Boxd>(kHalfSpace_m, kHalfSpace_m, kHalfSpace_m);
}

inline Eigen::Isometry3d fcl_transform(const lie::Pose& X) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = X.R;
  T.translation() = X.p;
  return T;
}

/// Of fcl_solid(s), where the shape is at X.
inline Eigen::Isometry3d fcl_transform(const geometry::Shape& s, lie::Pose X) {
  if (s.kind == geometry::ShapeKind::half_space) X.p -= 0.5 * kHalfSpace_m * X.R.col(2);
  return fcl_transform(X);
}

}  // namespace hamel::client
