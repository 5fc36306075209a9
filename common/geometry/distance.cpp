#include "common/geometry/distance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "common/geometry/convex.h"
#include "common/geometry/segment.h"

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kTouching_m = 1e-9;  // below it a direction is not determined

// Witnesses from axis point, normal and signed distance of the axis point to the obstacle.
void finish(const Capsule& link, double axis_distance_m, Closest& c) {
  c.distance_m = axis_distance_m - link.radius_m;
  c.on_link = c.on_axis + link.radius_m * c.normal;
  c.on_obstacle = c.on_axis + axis_distance_m * c.normal;
}

// Shared by sphere and capsule: everything within `radius_m` of a centre y.
void round_obstacle(const Capsule& link, const Vector3d& y, double radius_m, Closest& c) {
  const Vector3d to_centre = y - c.on_axis;
  const double D = to_centre.norm();
  c.degenerate = D < kTouching_m;
  if (c.degenerate) {
    const Vector3d across = unit_or_zero(c.link_axis.cross(c.obstacle_axis));
    c.normal = across.isZero() ? least_aligned(c.link_axis) : across;
  } else {
    c.normal = to_centre / D;
  }
  c.centre_m = D;
  finish(link, D - radius_m, c);
}

void against_sphere(const Capsule& link, const Shape& s, const lie::Pose& X_WO, Closest& c) {
  const Vector3d d = link.p1 - link.p0;
  const double t = nearest_on_segment(link.p0, d, X_WO.p);
  c.on_axis = link.p0 + t * d;
  c.slides_on_link = t > 0 && t < 1;
  round_obstacle(link, X_WO.p, s.dims_m[0], c);
}

void against_capsule(const Capsule& link, const Shape& s, const lie::Pose& X_WO, Closest& c) {
  const Vector3d half = 0.5 * s.dims_m[1] * X_WO.R.col(2);
  const Vector3d d = link.p1 - link.p0;
  const SegmentPair at = nearest_of_segments(link.p0, d, X_WO.p - half, 2 * half);
  c.on_axis = link.p0 + at.s * d;
  c.slides_on_link = at.s > 0 && at.s < 1 && !at.parallel;
  if (at.t > 0 && at.t < 1) c.obstacle_axis = unit_or_zero(half);
  round_obstacle(link, X_WO.p - half + at.t * 2 * half, s.dims_m[0], c);
}

void against_half_space(const Capsule& link, const lie::Pose& X_WO, Closest& c) {
  const Vector3d up = X_WO.R.col(2);
  const double z0 = up.dot(link.p0 - X_WO.p), z1 = up.dot(link.p1 - X_WO.p);
  c.on_axis = z0 < z1 ? link.p0 : z1 < z0 ? link.p1 : Vector3d(0.5 * (link.p0 + link.p1));
  c.normal = -up;
  finish(link, std::min(z0, z1), c);
}

// In the obstacle's frame: signed distance, outward gradient (from the obstacle to x) and how the surface
// bends.
struct Surface {
  double distance_m = 0;
  Vector3d outward = Vector3d::UnitZ();
  Vector3d axis = Vector3d::Zero();
  double radius_m = 0;  // of curvature; inf: flat
};

Surface box_surface(const Vector3d& half, const Vector3d& x) {
  const Vector3d q = x.cwiseAbs() - half;
  const Vector3d sign = x.unaryExpr([](double v) { return v < 0 ? -1.0 : 1.0; });
  const Vector3d out = q.cwiseMax(0.0);
  const double distance = out.norm();
  Surface s;
  if (distance < kTouching_m) {  // on or inside: the nearest face
    Eigen::Index face;
    s.distance_m = q.maxCoeff(&face);
    s.outward = sign[face] * Vector3d::Unit(face);
    s.radius_m = std::numeric_limits<double>::infinity();
    return s;
  }
  s.distance_m = distance;
  s.outward = sign.cwiseProduct(out) / distance;
  const int beyond = static_cast<int>((out.array() > 0).count());
  if (beyond == 1) s.radius_m = std::numeric_limits<double>::infinity();
  if (beyond == 2) {
    Eigen::Index along;
    out.minCoeff(&along);
    s.axis = Vector3d::Unit(along);
  }
  return s;
}

Surface cylinder_surface(double R, double half, const Vector3d& x) {
  const double r = std::hypot(x[0], x[1]);
  const Vector3d radial = r > 1e-12 ? Vector3d(x[0] / r, x[1] / r, 0) : Vector3d::UnitX();
  const Vector3d axial = (x[2] < 0 ? -1.0 : 1.0) * Vector3d::UnitZ();
  const double a = r - R, b = std::abs(x[2]) - half;
  Surface s;
  if (a > 0 && b > 0) {  // rim: straight along its tangent, which lies outside the disc
    s.distance_m = std::hypot(a, b);
    s.outward = (a * radial + b * axial) / s.distance_m;
    s.axis = Vector3d::UnitZ().cross(radial);
  } else if (a > b) {  // side
    s.distance_m = a;
    s.outward = radial;
    s.axis = Vector3d::UnitZ();
    s.radius_m = R;
  } else {  // cap
    s.distance_m = b;
    s.outward = axial;
    s.radius_m = std::numeric_limits<double>::infinity();
  }
  return s;
}

void against_solid(const Capsule& link, const lie::Pose& X_WO, double t, const Surface& s, Closest& c) {
  c.on_axis = link.p0 + t * (link.p1 - link.p0);
  c.normal = -(X_WO.R * s.outward);
  c.obstacle_axis = X_WO.R * s.axis;
  c.centre_m = std::max(s.distance_m, 0.0) + s.radius_m;
  c.slides_on_link = t > 0 && t < 1 && std::isfinite(c.centre_m);
  finish(link, s.distance_m, c);
}

void against_box(const Capsule& link, const Shape& s, const lie::Pose& X_WO, Closest& c) {
  const Vector3d half = 0.5 * s.dims_m;
  const Vector3d a = X_WO.R.transpose() * (link.p0 - X_WO.p), d = X_WO.R.transpose() * (link.p1 - link.p0);
  const double t = nearest_to_box(a, d, half);
  against_solid(link, X_WO, t, box_surface(half, a + t * d), c);
}

void against_cylinder(const Capsule& link, const Shape& s, const lie::Pose& X_WO, Closest& c) {
  const double R = s.dims_m[0], half = 0.5 * s.dims_m[1];
  const Vector3d a = X_WO.R.transpose() * (link.p0 - X_WO.p), d = X_WO.R.transpose() * (link.p1 - link.p0);
  const double t = nearest_to_cylinder(a, d, R, half);
  against_solid(link, X_WO, t, cylinder_surface(R, half, a + t * d), c);
}

}  // namespace

Vector3d least_aligned(const Vector3d& u) noexcept {
  Eigen::Index k;
  u.cwiseAbs().minCoeff(&k);
  const Vector3d e = Vector3d::Unit(k);
  return (e - u * u.dot(e)).normalized();
}

Capsule enclosing_capsule(const Shape& shape) noexcept {
  Capsule c;
  const Vector3d& m = shape.dims_m;
  Eigen::Index along = 2;
  double length = 0;
  if (shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule) c.radius_m = m[0];
  if (shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder) length = m[1];
  if (shape.kind == ShapeKind::cylinder) c.radius_m = c.excess_m = m[0];  // the round ends
  if (shape.kind == ShapeKind::box) {
    length = m.maxCoeff(&along);
    Vector3d across = m;
    across[along] = 0;
    c.radius_m = c.excess_m = 0.5 * across.norm();
  }
  c.p0[along] = -0.5 * length;
  c.p1[along] = 0.5 * length;
  return c;
}

Capsule operator*(const lie::Pose& X_AB, const Capsule& capsule_B) noexcept {
  return {X_AB * capsule_B.p0, X_AB * capsule_B.p1, capsule_B.radius_m, capsule_B.excess_m};
}

Closest closest(const Capsule& link_W, const Shape& obstacle, const lie::Pose& X_WO) noexcept {
  Closest c;
  c.link_axis = unit_or_zero(link_W.p1 - link_W.p0);
  switch (obstacle.kind) {
    case ShapeKind::sphere:
      against_sphere(link_W, obstacle, X_WO, c);
      break;
    case ShapeKind::capsule:
      against_capsule(link_W, obstacle, X_WO, c);
      break;
    case ShapeKind::cylinder:
      against_cylinder(link_W, obstacle, X_WO, c);
      break;
    case ShapeKind::box:
      against_box(link_W, obstacle, X_WO, c);
      break;
    case ShapeKind::half_space:
      against_half_space(link_W, X_WO, c);
      break;
  }
  return c;
}

double distance_bound(const Capsule& link_W, const Shape& obstacle, const lie::Pose& X_WO) noexcept {
  const Vector3d middle = 0.5 * (link_W.p0 + link_W.p1);
  const double reach = 0.5 * (link_W.p1 - link_W.p0).norm() + link_W.radius_m;
  const Vector3d& m = obstacle.dims_m;
  double radius = m[0];
  switch (obstacle.kind) {
    case ShapeKind::sphere:
      break;
    case ShapeKind::capsule:
      radius += 0.5 * m[1];
      break;
    case ShapeKind::cylinder:
      radius = std::hypot(m[0], 0.5 * m[1]);
      break;
    case ShapeKind::box:
      radius = 0.5 * m.norm();
      break;
    case ShapeKind::half_space:
      return X_WO.R.col(2).dot(middle - X_WO.p) - reach;
  }
  return (middle - X_WO.p).norm() - radius - reach;
}

}  // namespace hamel::geometry
