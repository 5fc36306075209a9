#pragma once
/// Obstacles as flat outlines, for pictures.

#include <utility>
#include <vector>

#include "common/geometry/shape.h"

namespace hamel::client {

using FlatPoint = std::pair<double, double>;

/// The outline of an obstacle, grown by `grow_m`, in the plane of the world's axes `across` and `up` (0 to
/// 2): the convex hull of enough of its surface, closed; empty for a half-space, which would fill the
/// picture.
std::vector<FlatPoint> outline(geometry::Obstacle o, double grow_m, int across, int up);

}  // namespace hamel::client
