#include "common/geometry/convex.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

constexpr int kMostSteps = 200;
constexpr double kConverged = 1e-12;  // relative, of the squared distance
constexpr double kTogether_m = 1e-9;  // below it a direction is not determined
constexpr double kApart_m = 1e-3;  // so far solids that are together are moved apart to see where they touch
constexpr double kParallel = 1e-10;  // of a direction's component: a tie

double sign(double x) { return x < 0 ? -1.0 : 1.0; }

// sign, or 0 for a tie.
double side(double n, bool middle) { return middle && std::abs(n) < kParallel ? 0.0 : sign(n); }

Vector3d farthest(const Shape& s, const Vector3d& n, bool middle) {
  const Vector3d& m = s.dims_m;
  switch (s.kind) {
    case ShapeKind::sphere:
      return m[0] * n.normalized();
    case ShapeKind::capsule:
      return m[0] * n.normalized() + Vector3d(0, 0, 0.5 * m[1] * side(n[2], middle));
    case ShapeKind::cylinder: {
      const double across = std::hypot(n[0], n[1]);
      const double r = across > (middle ? kParallel : 0.0) ? m[0] / across : 0.0;
      return {r * n[0], r * n[1], 0.5 * m[1] * side(n[2], middle)};
    }
    case ShapeKind::box:
      return 0.5 * Vector3d(m[0] * side(n[0], middle), m[1] * side(n[1], middle), m[2] * side(n[2], middle));
    case ShapeKind::half_space:
      break;
  }
  return Vector3d::Zero();
}

/// A point of the difference a - b, and where it comes from.
struct Vertex {
  Vector3d w, on_a, on_b;
};

/// The part of a simplex nearest to the origin.
struct Nearest {
  std::array<double, 4> weight{};
  Vector3d v = Vector3d::Zero();
  double squared = std::numeric_limits<double>::infinity();
};

// Weights of the affine combination of w[index[0..k)] nearest to the origin; false where they are no simplex.
bool affine_nearest(const std::array<Vertex, 4>& w, const std::array<std::size_t, 4>& index, std::size_t k,
                    std::array<double, 4>& weight) {
  const Vector3d& o = w[index[0]].w;
  Eigen::Matrix3d G = Eigen::Matrix3d::Identity();
  Vector3d rhs = Vector3d::Zero();
  for (std::size_t i = 1; i < k; ++i) {
    const auto r = static_cast<Eigen::Index>(i - 1);
    const Vector3d e = w[index[i]].w - o;
    rhs[r] = -e.dot(o);
    for (std::size_t j = 1; j < k; ++j) G(r, static_cast<Eigen::Index>(j - 1)) = e.dot(w[index[j]].w - o);
  }
  const double scale = G.diagonal().head(static_cast<Eigen::Index>(k) - 1).prod();
  if (k > 1 && !(G.determinant() > 1e-14 * scale)) return false;
  const Vector3d x = k > 1 ? Vector3d(G.inverse() * rhs) : Vector3d::Zero();
  weight[0] = 1;
  for (std::size_t i = 1; i < k; ++i) {
    weight[i] = x[static_cast<Eigen::Index>(i - 1)];
    weight[0] -= weight[i];
  }
  return true;
}

// All faces of the simplex are tried: fifteen at most, and none is missed by rounding.
Nearest nearest_of_simplex(const std::array<Vertex, 4>& w, std::size_t count) {
  Nearest best;
  for (unsigned mask = 1; mask < (1u << count); ++mask) {
    std::array<std::size_t, 4> index{};
    std::array<double, 4> weight{};
    std::size_t k = 0;
    for (std::size_t i = 0; i < count; ++i)
      if (mask & (1u << i)) index[k++] = i;
    if (!affine_nearest(w, index, k, weight)) continue;
    if (*std::min_element(weight.begin(), weight.begin() + static_cast<std::ptrdiff_t>(k)) < 0) continue;
    Vector3d v = Vector3d::Zero();
    for (std::size_t i = 0; i < k; ++i) v += weight[i] * w[index[i]].w;
    if (v.squaredNorm() >= best.squared) continue;
    best = {};
    best.v = v;
    best.squared = v.squaredNorm();
    for (std::size_t i = 0; i < k; ++i) best.weight[index[i]] = weight[i];
  }
  return best;
}

/// The two solids with what is asked of them.
class Two {
 public:
  Two(const Shape& a, const lie::Pose& X_Wa, const Shape& b, const lie::Pose& X_Wb)
      : a_(a), b_(b), X_Wa_(X_Wa), X_Wb_(X_Wb) {}

  /// Farthest of a along n and of b against it.
  Vertex far(const Vector3d& n, bool middle = false) const {
    const Vector3d on_a = X_Wa_ * farthest(a_, X_Wa_.R.transpose() * n, middle);
    const Vector3d on_b = X_Wb_ * farthest(b_, X_Wb_.R.transpose() * -n, middle);
    return {on_a - on_b, on_a, on_b};
  }
  /// How far apart the two are along the unit n; the largest over all n is the distance.
  double gap(const Vector3d& n) const { return -n.dot(far(n).w); }
  Vector3d between() const { return X_Wb_.p - X_Wa_.p; }

  /// False where they are together.
  bool apart(Separation& out) const;
  Separation together() const;

 private:
  void try_axis(const Vector3d& axis, Vector3d& best, double& most) const {
    const double length = axis.norm();
    if (!(length > 1e-6)) return;
    for (const double s : {1.0, -1.0}) {
      const Vector3d n = s / length * axis;
      const double d = gap(n);
      if (d > most) most = d, best = n;
    }
  }
  const Shape &a_, &b_;
  const lie::Pose &X_Wa_, &X_Wb_;
};

bool Two::apart(Separation& out) const {
  std::array<Vertex, 4> w;
  w[0] = far(between().norm() > kTogether_m ? between() : Vector3d(Vector3d::UnitX()));
  std::size_t count = 1;
  Nearest at = nearest_of_simplex(w, count);
  for (int step = 0; step < kMostSteps && at.squared > kTogether_m * kTogether_m; ++step) {
    const Vertex next = far(-at.v);
    if (at.squared - at.v.dot(next.w) <= kConverged * at.squared) break;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i)
      if (at.weight[i] > 0) w[kept++] = w[i];
    if (kept == 4) break;
    w[kept++] = next;
    count = kept;
    const Nearest found = nearest_of_simplex(w, count);
    if (!(found.squared < at.squared)) {
      // No progress left: the weights of before belong to w without its last.
      at = nearest_of_simplex(w, count - 1);
      break;
    }
    at = found;
  }
  if (at.squared <= kTogether_m * kTogether_m) return false;
  out.on_a = out.on_b = Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(at.weight[i] > 0)) continue;
    out.on_a += at.weight[i] * w[i].on_a;
    out.on_b += at.weight[i] * w[i].on_b;
  }
  out.distance_m = std::sqrt(at.squared);
  out.normal = -at.v / out.distance_m;
  return true;
}

Separation Two::together() const {
  Vector3d n = Vector3d::UnitZ();
  double most = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    try_axis(X_Wa_.R.col(i), n, most);
    try_axis(X_Wb_.R.col(i), n, most);
    for (int j = 0; j < 3; ++j) try_axis(X_Wa_.R.col(i).cross(X_Wb_.R.col(j)), n, most);
  }
  try_axis(between(), n, most);
  for (const Vector3d& axis : {Vector3d(X_Wa_.R.col(2)), Vector3d(X_Wb_.R.col(2))})
    try_axis(between() - axis * axis.dot(between()), n, most);
  // Round parts have no finite set of axes: walk to the best direction nearby.
  double step = 0.3;
  for (int walk = 0; walk < 300 && step > 1e-8; ++walk) {
    const Vector3d u = n.unitOrthogonal(), v = n.cross(u), before = n;
    for (int k = 0; k < 8; ++k) {
      const double angle = 0.25 * k * 3.141592653589793;
      const Vector3d tried = (before + step * (std::cos(angle) * u + std::sin(angle) * v)).normalized();
      const double d = gap(tried);
      if (d > most) most = d, n = tried;
    }
    if (n == before) step *= 0.5;
  }
  // Moved apart along n they touch where they are deepest, and their distance says where n could be better:
  // d' >= kApart_m along n' makes the depth along n' the smaller one.
  Separation out;
  for (int k = 0; k < 50; ++k) {
    lie::Pose X_Wb = X_Wb_;
    X_Wb.p += (kApart_m - most) * n;
    if (!Two(a_, X_Wa_, b_, X_Wb).apart(out)) {
      out.on_a = far(n, true).on_a;
      break;
    }
    const double d = gap(out.normal);
    if (!(d > most + 1e-12)) break;
    most = d;
    n = out.normal;
  }
  return {most, n, out.on_a, out.on_a + most * n};
}

}  // namespace

Vector3d support(const Shape& s, const Vector3d& n) noexcept { return farthest(s, n, false); }
Vector3d support_middle(const Shape& s, const Vector3d& n) noexcept { return farthest(s, n, true); }

Separation separation(const Shape& a, const lie::Pose& X_Wa, const Shape& b, const lie::Pose& X_Wb) noexcept {
  const Two two(a, X_Wa, b, X_Wb);
  Separation out;
  if (two.apart(out)) return out;
  return two.together();
}

Vector3d unit_or_zero(const Vector3d& v) noexcept {
  const double length = v.norm();
  return length > 1e-12 ? Vector3d(v / length) : Vector3d::Zero();
}

}  // namespace hamel::geometry
