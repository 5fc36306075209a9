#include "common/geometry/solid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "common/geometry/convex.h"

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kOnFeature = 1e-7;  // of a shape's size: so near an edge or rim a point counts as on it

bool is_round(const Shape& s) { return s.kind == ShapeKind::sphere || s.kind == ShapeKind::capsule; }

double bound(const Shape& s) {
  const Vector3d& m = s.dims_m;
  switch (s.kind) {
    case ShapeKind::sphere:
      return m[0];
    case ShapeKind::capsule:
      return m[0] + 0.5 * m[1];
    case ShapeKind::cylinder:
      return std::hypot(m[0], 0.5 * m[1]);
    case ShapeKind::box:
      return 0.5 * m.norm();
    case ShapeKind::half_space:
      break;
  }
  return kInf;
}

void span_face(const Vector3d& n, Vector3d& u, Vector3d& v) {
  u = least_aligned(n);
  v = n.cross(u);
}

/// The same pair with the two solids' roles changed: the link was the obstacle.
Closest reversed(const Closest& c) {
  Closest r = c;
  r.normal = -c.normal;
  std::swap(r.on_link, r.on_obstacle);
  const bool flat = !std::isfinite(c.centre_m) || !c.obstacle_axis2.isZero();
  r.link_axis = c.obstacle_axis;
  r.link_axis2 = Vector3d::Zero();
  r.obstacle_axis2 = Vector3d::Zero();
  r.slides_on_link = !c.obstacle_axis.isZero();
  r.obstacle_axis = c.slides_on_link ? c.link_axis : Vector3d::Zero();
  if (flat) {
    r.on_axis = c.on_obstacle;
    r.centre_m = std::max((c.on_axis - c.on_obstacle).norm(), 0.0);
    span_face(r.normal, r.link_axis, r.link_axis2);
  } else {
    r.on_axis = c.on_axis + c.centre_m * c.normal;
  }
  return r;
}

/// The lowest point of a box or cylinder over a half-space; the middle where it lies flat.
Closest over_half_space(const Solid& link, const Solid& half_space) {
  Closest c;
  const Vector3d up = half_space.X.R.col(2);
  c.on_link = link.X * support_middle(link.shape, link.X.R.transpose() * -up);
  c.on_axis = c.on_link;
  c.normal = -up;
  c.distance_m = up.dot(c.on_link - half_space.X.p);
  c.on_obstacle = c.on_link - c.distance_m * up;
  return c;
}

/// What a box or cylinder is like about a point of its surface, world axes.
struct Feature {
  Vector3d u = Vector3d::Zero(), v = Vector3d::Zero();  // it is straight along these
  double radius_m = 0;                                  // of curvature across them
};

Feature feature(const Solid& s, const Vector3d& at_W, const Vector3d& outward_W) {
  const Vector3d x = s.X.R.transpose() * (at_W - s.X.p), n = s.X.R.transpose() * outward_W;
  Feature f;
  if (s.shape.kind == ShapeKind::box) {
    std::array<Vector3d, 3> free;
    std::size_t count = 0;
    for (int i = 0; i < 3; ++i) {
      const double half = 0.5 * s.shape.dims_m[i];
      if (half - std::abs(x[i]) > kOnFeature * s.bound_m) free[count++] = s.X.R.col(i);
    }
    if (count >= 1) f.u = free[0];
    if (count >= 2) f.v = free[1];
    return f;
  }
  const double R = s.shape.dims_m[0], half = 0.5 * s.shape.dims_m[1];
  const bool side = std::abs(n[2]) < 1e-9, cap = n.head<2>().norm() < 1e-9;
  if (cap) {
    f.u = s.X.R.col(0);
    f.v = s.X.R.col(1);
  } else if (side && std::abs(x[2]) < half) {
    f.u = s.X.R.col(2);
    f.radius_m = R;
  } else {  // rim: straight along its tangent, which lies outside the disc
    f.u = unit_or_zero(s.X.R * Vector3d(-x[1], x[0], 0));
  }
  return f;
}

Closest of_convex(const Solid& link, const Solid& obstacle) {
  const Separation apart = separation(link.shape, link.X, obstacle.shape, obstacle.X);
  Closest c;
  c.distance_m = apart.distance_m;
  c.normal = apart.normal;
  c.on_link = apart.on_a;
  c.on_obstacle = apart.on_b;
  const Feature a = feature(link, c.on_link, c.normal), b = feature(obstacle, c.on_obstacle, -c.normal);
  c.on_axis = c.on_link - a.radius_m * c.normal;
  c.centre_m = a.radius_m + std::max(c.distance_m, 0.0) + b.radius_m;
  c.link_axis = a.u;
  c.link_axis2 = a.v;
  c.slides_on_link = !a.u.isZero();
  c.obstacle_axis = b.u;
  c.obstacle_axis2 = b.v;
  return c;
}

}  // namespace

Solid solid(const Shape& shape, const lie::Pose& X_AS) noexcept {
  Solid s{shape, X_AS, is_round(shape), {}, bound(shape)};
  if (s.round) s.capsule = X_AS * enclosing_capsule(shape);
  return s;
}

Solid operator*(const lie::Pose& X_AB, const Solid& b) noexcept {
  Solid s{b.shape, X_AB * b.X, b.round, {}, b.bound_m};
  if (s.round) s.capsule = X_AB * b.capsule;
  return s;
}

Closest closest(const Solid& link_W, const Solid& obstacle_W) noexcept {
  if (link_W.shape.kind == ShapeKind::half_space) return {};
  if (link_W.round) return closest(link_W.capsule, obstacle_W.shape, obstacle_W.X);
  if (obstacle_W.round) return reversed(closest(obstacle_W.capsule, link_W.shape, link_W.X));
  if (obstacle_W.shape.kind == ShapeKind::half_space) return over_half_space(link_W, obstacle_W);
  return of_convex(link_W, obstacle_W);
}

}  // namespace hamel::geometry
