#pragma once
/// Fewer and rounder solids in place of many: always outward, and by how much.

#include <cstddef>
#include <span>
#include <vector>

#include "common/geometry/distance.h"

namespace hamel::geometry {

/// A capsule around a shape, in the shape's frame, whose largest excess is the least: of a cylinder of radius
/// r it reaches 0.41 r beyond, where enclosing_capsule(), which shares the axis' ends, reaches r.  excess_m
/// is exact.  Half-spaces: as enclosing_capsule().
Capsule tight_capsule(const Shape& shape) noexcept;

/// A capsule that holds all of `members` (at least one).
///
/// Its axis lies along the two ends that are farthest apart.  excess_m: no point of it is farther from the
/// union of the members than this, and what a member itself exceeds comes on top.  With R the radius, and at
/// a point of the axis par the way along it to a member of radius r that is e beside it,
///   excess(point) = least over the members of sqrt(par^2 + (e + R)^2) - r,
/// looked at in 128 intervals, each at its worst.  O(members).
Capsule hull(std::span<const Capsule> members);

/// Parts solids into groups whose hulls exceed them by no more than `room_m` of each member.
///
/// Greedy: from the first that is left on, the nearest that fits next.
/// @return for each the index of its group's first member
/// Cost O(members^2).  Allocates.
std::vector<std::size_t> group(std::span<const Capsule> members, std::span<const double> room_m);

}  // namespace hamel::geometry
