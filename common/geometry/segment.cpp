#include "common/geometry/segment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kRounding_m = 1e-9;  // a distance this small may be a penetration

double clamp01(double t) { return std::clamp(t, 0.0, 1.0); }

// How far x stands beyond [-half, half], with its sign.
double excess(double x, double half) { return x > half ? x - half : x < -half ? x + half : 0.0; }

// Half the derivative of the squared distance to the box: monotone, piecewise linear.
double box_slope(const Vector3d& a, const Vector3d& d, const Vector3d& half, double t) {
  double g = 0;
  for (int i = 0; i < 3; ++i) g += excess(a[i] + t * d[i], half[i]) * d[i];
  return g;
}

double box_signed(const Vector3d& a, const Vector3d& d, const Vector3d& half, double t) {
  const Vector3d q = (a + t * d).cwiseAbs() - half;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

// The segment goes through the box: depth is the largest of six linear functions, lowest where two of them
// cross.
double deepest_in_box(const Vector3d& a, const Vector3d& d, const Vector3d& half, double from) {
  double best_t = from, best = box_signed(a, d, half, from);
  const auto consider = [&](double t) {
    if (!(t >= 0 && t <= 1)) return;
    const double s = box_signed(a, d, half, t);
    if (s < best) best = s, best_t = t;
  };
  consider(0);
  consider(1);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < i; ++j) {
      const int p = i % 3, r = j % 3;
      const double si = i < 3 ? 1 : -1, sj = j < 3 ? 1 : -1;
      const double slope = si * d[p] - sj * d[r];
      if (slope != 0) consider(((sj * a[r] - half[r]) - (si * a[p] - half[p])) / slope);
    }
  return best_t;
}

double cylinder_signed(const Vector3d& x, double R, double half) {
  const double u = std::hypot(x[0], x[1]) - R, v = std::abs(x[2]) - half;
  return std::hypot(std::max(u, 0.0), std::max(v, 0.0)) + std::min(std::max(u, v), 0.0);
}

// Half the derivative of the squared distance to the cylinder: monotone.
double cylinder_slope(const Vector3d& a, const Vector3d& d, double R, double half, double t) {
  const Vector3d x = a + t * d;
  const double r = std::hypot(x[0], x[1]);
  const double radial = r > R && r > 0 ? (r - R) * (x[0] * d[0] + x[1] * d[1]) / r : 0.0;
  return radial + excess(x[2], half) * d[2];
}

// The segment goes through the cylinder: max(r - R, |z| - half) is lowest where r is, where z = 0, or where
// both meet: r^2 = (R - half +- z)^2, a quadratic for each cap.
double deepest_in_cylinder(const Vector3d& a, const Vector3d& d, double R, double half, double from) {
  double best_t = from, best = cylinder_signed(a + from * d, R, half);
  const auto consider = [&](double t) {
    if (!(t >= 0 && t <= 1)) return;
    const double s = cylinder_signed(a + t * d, R, half);
    if (s < best) best = s, best_t = t;
  };
  consider(0);
  consider(1);
  const double dd = d.head<2>().squaredNorm(), ad = a.head<2>().dot(d.head<2>()),
               aa = a.head<2>().squaredNorm();
  if (dd > 0) consider(-ad / dd);
  if (d[2] != 0) consider(-a[2] / d[2]);
  for (const double sign : {1.0, -1.0}) {
    const double k = R - half + sign * a[2];
    const double A = dd - d[2] * d[2], B = ad - sign * d[2] * k, C = aa - k * k;
    if (A == 0) {
      if (B != 0) consider(-0.5 * C / B);
      continue;
    }
    const double root = B * B - A * C;
    if (root < 0) continue;
    consider((-B + std::sqrt(root)) / A);
    consider((-B - std::sqrt(root)) / A);
  }
  return best_t;
}

}  // namespace

double nearest_on_segment(const Vector3d& a, const Vector3d& d, const Vector3d& x) noexcept {
  const double dd = d.squaredNorm();
  return dd > 0 ? clamp01((x - a).dot(d) / dd) : 0.0;
}

SegmentPair nearest_of_segments(const Vector3d& a, const Vector3d& d, const Vector3d& b,
                                const Vector3d& e) noexcept {
  const double dd = d.squaredNorm(), ee = e.squaredNorm();
  if (dd == 0) return {0, nearest_on_segment(b, e, a), false};
  if (ee == 0) return {nearest_on_segment(a, d, b), 0, false};
  const Vector3d r = a - b;
  const double de = d.dot(e), dr = d.dot(r), er = e.dot(r);
  const double across = d.cross(e).squaredNorm();
  SegmentPair at;
  if (across <= 1e-20 * dd * ee) {  // parallel: the middle of where they overlap, seen on the first
    at.parallel = true;
    const double s0 = clamp01(-dr / dd), s1 = clamp01((de - dr) / dd);
    at.s = 0.5 * (s0 + s1);
    at.t = nearest_on_segment(b, e, a + at.s * d);
    return at;
  }
  at.s = clamp01((de * er - dr * ee) / across);
  at.t = (de * at.s + er) / ee;
  if (at.t < 0 || at.t > 1) {
    at.t = clamp01(at.t);
    at.s = clamp01((de * at.t - dr) / dd);
  }
  return at;
}

double nearest_to_box(const Vector3d& a, const Vector3d& d, const Vector3d& half) noexcept {
  std::array<double, 8> knots{0, 1};  // where a face is crossed, sorted
  std::size_t n = 2;
  for (int i = 0; i < 3; ++i)
    for (const double side : {-half[i], half[i]}) {
      const double t = (side - a[i]) / d[i];
      if (!(t > 0 && t < 1)) continue;
      std::size_t k = n++;
      for (; knots[k - 1] > t; --k) knots[k] = knots[k - 1];
      knots[k] = t;
    }
  // The first t where the slope is no longer negative and the last where it is not yet positive.
  const auto slope = [&](std::size_t k) { return box_slope(a, d, half, knots[k]); };
  const auto crossing = [&](std::size_t k) {
    const double g0 = slope(k), g1 = slope(k + 1);
    return knots[k] - g0 * (knots[k + 1] - knots[k]) / (g1 - g0);
  };
  std::size_t up = 0, down = n - 1;
  while (up < n && slope(up) < 0) ++up;
  while (down > 0 && slope(down) > 0) --down;
  const double first = up == 0 ? 0.0 : up == n ? 1.0 : crossing(up - 1);
  const double last = down == n - 1     ? 1.0
                      : slope(down) > 0 ? 0.0
                      : slope(down) < 0 ? crossing(down)
                                        : knots[down];
  const double t = clamp01(0.5 * (first + last));
  return box_signed(a, d, half, t) > kRounding_m ? t : deepest_in_box(a, d, half, t);
}

double nearest_to_cylinder(const Vector3d& a, const Vector3d& d, double R, double half) noexcept {
  // The slope changes sign once; where it stays zero, both ends of the tie are found.
  const auto root = [&](auto still_left) {
    if (!still_left(cylinder_slope(a, d, R, half, 0))) return 0.0;
    if (still_left(cylinder_slope(a, d, R, half, 1))) return 1.0;
    double low = 0, high = 1;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      if (middle <= low || middle >= high) break;
      (still_left(cylinder_slope(a, d, R, half, middle)) ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double t = 0.5 * (root([](double g) { return g < 0; }) + root([](double g) { return g <= 0; }));
  return cylinder_signed(a + t * d, R, half) > kRounding_m ? t : deepest_in_cylinder(a, d, R, half, t);
}

}  // namespace hamel::geometry
