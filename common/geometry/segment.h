#pragma once
/// Where on a segment a + t d, 0 <= t <= 1, a solid is nearest or deepest.  Solids stand in their own frame.

#include <Eigen/Core>

namespace hamel::geometry {

/// t nearest to the point x; 0 for a segment of no length.
double nearest_on_segment(const Eigen::Vector3d& a, const Eigen::Vector3d& d,
                          const Eigen::Vector3d& x) noexcept;

struct SegmentPair {
  double s = 0, t = 0;    ///< on the first and on the second segment
  bool parallel = false;  ///< the middle of a tie
};
/// Closest points of a + s d and b + t e.
SegmentPair nearest_of_segments(const Eigen::Vector3d& a, const Eigen::Vector3d& d, const Eigen::Vector3d& b,
                                const Eigen::Vector3d& e) noexcept;

/// t with the least signed distance to the box |x_i| <= half_i.  Exact: the squared distance is a convex
/// piecewise quadratic, the depth a convex piecewise linear function of t.
double nearest_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& d,
                      const Eigen::Vector3d& half) noexcept;

/// t with the least signed distance to the cylinder x^2 + y^2 <= R^2, |z| <= half.
double nearest_to_cylinder(const Eigen::Vector3d& a, const Eigen::Vector3d& d, double R,
                           double half) noexcept;

}  // namespace hamel::geometry
