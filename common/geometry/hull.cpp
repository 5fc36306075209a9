#include "common/geometry/hull.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/geometry/segment.h"

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr int kIntervals = 128;
constexpr double kPoint_m = 1e-12;  // a shorter axis is none

/// A member against the hull's axis.
struct Span {
  double t0 = 0, t1 = 0;  // along it, t0 <= t1
  double beside = 0;      // at most
  double radius = 0, excess = 0;
};

Vector3d farthest_end(std::span<const Capsule> members, const Vector3d& from) {
  Vector3d best = from;
  for (const Capsule& c : members)
    for (const Vector3d* p : {&c.p0, &c.p1})
      if ((*p - from).squaredNorm() > (best - from).squaredNorm()) best = *p;
  return best;
}

/// How far a point of the hull that is seen from t (give or take `slack`) may be from the members.
/// `end`: -1 at the low end, 1 at the high one, else 0.
double excess_at(const std::vector<Span>& spans, double t, double slack, double radius, int end) {
  double least = kInf;
  for (const Span& s : spans) {
    const bool inward = (end < 0 && s.t0 > t) || (end > 0 && s.t1 < t);
    const double par = std::max({s.t0 - t, t - s.t1, 0.0}) + slack;
    // Round an end its points lie along the axis, too.
    const double way = inward ? radius + std::hypot(par, s.beside) : std::hypot(par, s.beside + radius);
    least = std::min(least, way - s.radius + s.excess);
  }
  return least;
}

}  // namespace

Capsule tight_capsule(const Shape& shape) noexcept {
  Capsule c = enclosing_capsule(shape);
  const bool box = shape.kind == ShapeKind::box;
  if (!box && shape.kind != ShapeKind::cylinder) return c;
  // Ends drawn in by `in`, the radius grown to hold the rim: R^2 = r^2 + in^2.  It reaches R - in beyond the
  // ends and R - m beyond the flanks that are nearest: equal for in = m.
  Vector3d half = 0.5 * shape.dims_m;
  if (!box) half = Vector3d(shape.dims_m[0], shape.dims_m[0], 0.5 * shape.dims_m[1]);
  Eigen::Index along = 2;
  if (box) half.maxCoeff(&along);
  const double length = half[along];
  half[along] = kInf;
  const double flank = half.minCoeff(), in = std::min(flank, length);
  const double r = box ? c.radius_m : shape.dims_m[0];
  c.radius_m = std::hypot(r, in);
  c.excess_m = c.radius_m - in;
  c.p0[along] = in - length;
  c.p1[along] = length - in;
  return c;
}

Capsule hull(std::span<const Capsule> members) {
  const Vector3d a = farthest_end(members, members.front().p0), b = farthest_end(members, a);
  const double length = (b - a).norm();
  const Vector3d u = length > kPoint_m ? Vector3d((b - a) / length) : Vector3d(Vector3d::Zero());
  std::vector<Span> spans;
  Capsule out;
  for (const Capsule& c : members) {
    const double t0 = u.dot(c.p0 - a), t1 = u.dot(c.p1 - a);
    const double e0 = (c.p0 - a - t0 * u).norm(), e1 = (c.p1 - a - t1 * u).norm();
    spans.push_back({std::min(t0, t1), std::max(t0, t1), std::max(e0, e1), c.radius_m, c.excess_m});
    out.radius_m = std::max(out.radius_m, std::max(e0, e1) + c.radius_m);
  }
  // The axis need not go to the end of a member that its radius holds from farther in.
  double low = kInf, high = -kInf;
  for (const Span& s : spans) {
    const double room = out.radius_m - s.radius,
                 reach = std::sqrt(std::max(room * room - s.beside * s.beside, 0.0));
    low = std::min(low, s.t0 + reach);
    high = std::max(high, s.t1 - reach);
  }
  if (low > high) low = high = 0.5 * (low + high);
  out.p0 = a + low * u;
  out.p1 = a + high * u;
  const double slack = 0.5 * (high - low) / kIntervals;
  out.excess_m =
      std::max(excess_at(spans, low, 0, out.radius_m, -1), excess_at(spans, high, 0, out.radius_m, 1));
  for (int k = 0; k < kIntervals && slack > 0; ++k)
    out.excess_m =
        std::max(out.excess_m, excess_at(spans, low + (2 * k + 1) * slack, slack, out.radius_m, 0));
  return out;
}

std::vector<std::size_t> group(std::span<const Capsule> members, std::span<const double> room_m) {
  const std::size_t n = members.size();
  std::vector<std::size_t> first_of(n);
  std::vector<bool> taken(n, false), tried(n);
  std::vector<Capsule> chain;
  for (std::size_t i = 0; i < n; ++i) {
    if (taken[i]) continue;
    first_of[i] = i;
    chain.assign(1, members[i]);
    Capsule whole = members[i];
    double room = room_m[i];
    std::fill(tried.begin(), tried.end(), false);
    for (;;) {
      std::size_t next = n;
      double nearest = kInf;
      for (std::size_t j = i + 1; j < n; ++j) {
        if (taken[j] || tried[j]) continue;
        const Vector3d d = whole.p1 - whole.p0, e = members[j].p1 - members[j].p0;
        const SegmentPair at = nearest_of_segments(whole.p0, d, members[j].p0, e);
        const double apart = (whole.p0 + at.s * d - members[j].p0 - at.t * e).norm();
        // Even two balls of the larger radius so far apart would not fit.
        const double r = std::max(whole.radius_m, members[j].radius_m);
        if (std::hypot(0.5 * apart, r) - r > std::min(room, room_m[j])) continue;
        if (apart < nearest) nearest = apart, next = j;
      }
      if (next == n) break;
      tried[next] = true;
      chain.push_back(members[next]);
      const Capsule grown = hull(chain);
      const double allowed = std::min(room, room_m[next]);
      if (grown.excess_m > allowed) {
        chain.pop_back();
        continue;
      }
      whole = grown;
      room = allowed;
      taken[next] = true;
      first_of[next] = i;
    }
  }
  return first_of;
}

}  // namespace hamel::geometry
