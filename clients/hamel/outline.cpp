#include "clients/hamel/outline.h"

#include <algorithm>
#include <cmath>

namespace hamel::client {

namespace {

/// Corners and rims of a solid, enough for an outline; world frame.
std::vector<Eigen::Vector3d> outline_points(const geometry::Obstacle& o) {
  std::vector<Eigen::Vector3d> points;
  const auto& d = o.shape.dims_m;
  const auto add = [&](double x, double y, double z) { points.push_back(o.X_WO * Eigen::Vector3d(x, y, z)); };
  const auto ball = [&](double radius, double z) {
    for (int i = 0; i < 24; ++i)
      for (int j = -5; j <= 5; ++j) {
        const double a = i * M_PI / 12, b = j * M_PI / 10;
        add(radius * std::cos(a) * std::cos(b), radius * std::sin(a) * std::cos(b), z + radius * std::sin(b));
      }
  };
  switch (o.shape.kind) {
    case geometry::ShapeKind::sphere:
      ball(d[0], 0);
      break;
    case geometry::ShapeKind::capsule:
      ball(d[0], d[1] / 2), ball(d[0], -d[1] / 2);
      break;
    case geometry::ShapeKind::cylinder:
      for (int i = 0; i < 24; ++i)
        for (const double z : {-d[1] / 2, d[1] / 2})
          add(d[0] * std::cos(i * M_PI / 12), d[0] * std::sin(i * M_PI / 12), z);
      break;
    case geometry::ShapeKind::box:
      for (const double x : {-0.5, 0.5})
        for (const double y : {-0.5, 0.5})
          for (const double z : {-0.5, 0.5}) add(x * d[0], y * d[1], z * d[2]);
      break;
    case geometry::ShapeKind::half_space:
      break;  // fills the picture: not drawn
  }
  return points;
}

/// Convex hull, counter-clockwise (monotone chain).
std::vector<FlatPoint> hull(std::vector<FlatPoint> p) {
  std::sort(p.begin(), p.end());
  const auto cross = [](const FlatPoint& o, const FlatPoint& a, const FlatPoint& b) {
    return (a.first - o.first) * (b.second - o.second) - (a.second - o.second) * (b.first - o.first);
  };
  std::vector<FlatPoint> h;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = h.size();
    for (const FlatPoint& q : p) {
      while (h.size() >= base + 2 && cross(h[h.size() - 2], h.back(), q) <= 0) h.pop_back();
      h.push_back(q);
    }
    if (!h.empty()) h.pop_back();
    std::reverse(p.begin(), p.end());
  }
  return h;
}

}  // namespace

std::vector<FlatPoint> outline(geometry::Obstacle o, double grow_m, int across, int up) {
  if (o.shape.kind == geometry::ShapeKind::box)
    o.shape.dims_m.array() += 2 * grow_m;
  else
    o.shape.dims_m[0] += grow_m;
  if (o.shape.kind == geometry::ShapeKind::cylinder) o.shape.dims_m[1] += 2 * grow_m;
  std::vector<FlatPoint> flat;
  for (const auto& p : outline_points(o)) flat.emplace_back(p[across], p[up]);
  if (flat.empty()) return flat;
  std::vector<FlatPoint> h = hull(std::move(flat));
  h.push_back(h.front());
  return h;
}

}  // namespace hamel::client
