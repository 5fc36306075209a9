#pragma once
/// Shapes and obstacles as plain numbers; their distances are in distance.h.

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "common/lie/se3.h"

namespace hamel::geometry {

enum class ShapeKind : std::uint8_t { sphere, capsule, cylinder, box, half_space };

/// A solid in its own frame S.
///   sphere      radius dims_m[0] about the origin
///   capsule     segment of length dims_m[1] along z, centred, radius dims_m[0]
///   cylinder    length dims_m[1] along z, centred, radius dims_m[0]
///   box         full edges dims_m[0..2] along x, y, z, centred
///   half_space  everything with z <= 0
struct Shape {
  ShapeKind kind = ShapeKind::sphere;
  Eigen::Vector3d dims_m = Eigen::Vector3d::Zero();
};

/// A shape in the world with its motion.
struct Obstacle {
  std::uint32_t id = 0;
  Shape shape;
  lie::Pose X_WO;
  lie::Twist V_WO = lie::Twist::Zero();  ///< (omega, v) of the obstacle's origin, world axes [rad/s, m/s]
  bool velocity_known = true;            ///< false: V_WO means nothing
  double sigma_m = 0;                    ///< standard deviation of the position
  /// When it was where X_WO says, on the run's clock [s]; NaN: as long ago as its set is old.
  double seen_s = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace hamel::geometry
