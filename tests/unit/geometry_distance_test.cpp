// Distances against brute force over the axis, closed forms, and every degenerate case.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "common/geometry/distance.h"

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

Shape sphere(double r) { return {ShapeKind::sphere, {r, 0, 0}}; }
Shape capsule(double r, double l) { return {ShapeKind::capsule, {r, l, 0}}; }
Shape cylinder(double r, double l) { return {ShapeKind::cylinder, {r, l, 0}}; }
Shape box(double x, double y, double z) { return {ShapeKind::box, {x, y, z}}; }
Shape half_space() { return {ShapeKind::half_space, Vector3d::Zero()}; }

// Signed distance of a point, written independently of the library: positive outside.
double signed_distance(const Shape& s, const Vector3d& x) {
  const Vector3d& m = s.dims_m;
  switch (s.kind) {
    case ShapeKind::sphere:
      return x.norm() - m[0];
    case ShapeKind::capsule: {
      const double z = std::clamp(x[2], -m[1] / 2, m[1] / 2);
      return (x - Vector3d(0, 0, z)).norm() - m[0];
    }
    case ShapeKind::cylinder: {
      const double a = std::hypot(x[0], x[1]) - m[0], b = std::abs(x[2]) - m[1] / 2;
      return a > 0 && b > 0 ? std::hypot(a, b) : std::max(a, b);
    }
    case ShapeKind::box: {
      const Vector3d q = x.cwiseAbs() - m / 2;
      return q.maxCoeff() > 0 ? q.cwiseMax(0.0).norm() : q.maxCoeff();
    }
    case ShapeKind::half_space:
      return x[2];
  }
  return 0;
}

// Least over the axis: golden section on a convex function.
double brute_force(const Capsule& link, const Shape& s, const lie::Pose& X_WO) {
  const auto f = [&](double t) {
    return signed_distance(s, X_WO.R.transpose() * (link.p0 + t * (link.p1 - link.p0) - X_WO.p));
  };
  double a = 0, b = 1;
  const double g = 0.5 * (std::sqrt(5.0) - 1);
  for (int k = 0; k < 90; ++k) {
    const double c = b - g * (b - a), d = a + g * (b - a);
    (f(c) < f(d) ? b : a) = f(c) < f(d) ? d : c;
  }
  return std::min({f(a), f(0), f(1)}) - link.radius_m;
}

struct Random {
  std::mt19937_64 rng;
  double in(double a, double b) { return std::uniform_real_distribution<>{a, b}(rng); }
  Vector3d point(double r) { return {in(-r, r), in(-r, r), in(-r, r)}; }
  lie::Pose pose(double r) {
    return {Eigen::Quaterniond(in(-1, 1), in(-1, 1), in(-1, 1), in(-1, 1)).normalized().toRotationMatrix(),
            point(r)};
  }
};

class ForShape : public testing::TestWithParam<Shape> {};

TEST_P(ForShape, AgreesWithASearchOverTheAxis) {
  Random r{std::mt19937_64{7}};
  for (int k = 0; k < 20000; ++k) {
    const Capsule link{r.point(1), r.point(1), r.in(0, 0.2), 0};
    const lie::Pose X_WO = r.pose(0.8);
    const Closest c = closest(link, GetParam(), X_WO);
    ASSERT_NEAR(c.distance_m, brute_force(link, GetParam(), X_WO), 1e-9) << "case " << k;
    ASSERT_LE(distance_bound(link, GetParam(), X_WO), c.distance_m + 1e-12);
  }
}

TEST_P(ForShape, WitnessesLieOnBothSurfacesAlongTheNormal) {
  Random r{std::mt19937_64{8}};
  for (int k = 0; k < 20000; ++k) {
    const Capsule link{r.point(1), r.point(1), r.in(0, 0.2), 0};
    const lie::Pose X_WO = r.pose(1.5);
    const Closest c = closest(link, GetParam(), X_WO);
    ASSERT_NEAR(c.normal.norm(), 1, 1e-14);
    ASSERT_NEAR((c.on_obstacle - c.on_link - c.distance_m * c.normal).norm(), 0, 1e-13);
    ASSERT_NEAR((c.on_link - c.on_axis - link.radius_m * c.normal).norm(), 0, 1e-13);
    ASSERT_NEAR(signed_distance(GetParam(), X_WO.R.transpose() * (c.on_obstacle - X_WO.p)), 0, 1e-9)
        << "case " << k;
  }
}

// d/d(translation of the obstacle) of the distance is n: the sign convention of every force.
TEST_P(ForShape, NormalIsTheGradientOfTheDistance) {
  Random r{std::mt19937_64{9}};
  for (int k = 0; k < 5000; ++k) {
    const Capsule link{r.point(1), r.point(1), r.in(0, 0.2), 0};
    const lie::Pose X_WO = r.pose(1.5);
    const Closest c = closest(link, GetParam(), X_WO);
    if (c.distance_m + link.radius_m < 1e-3) continue;  // kinks inside
    const double h = 1e-6;
    for (int i = 0; i < 3; ++i) {
      lie::Pose plus = X_WO, minus = X_WO;
      plus.p[i] += h, minus.p[i] -= h;
      const double slope =
          (closest(link, GetParam(), plus).distance_m - closest(link, GetParam(), minus).distance_m) /
          (2 * h);
      ASSERT_NEAR(slope, c.normal[i], 2e-3) << "case " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Obstacles, ForShape,
                         testing::Values(sphere(0.3), sphere(0), capsule(0.2, 0.6), capsule(0.1, 0),
                                         box(0.4, 0.6, 0.2), box(0.5, 0, 0.5), cylinder(0.3, 0.5),
                                         cylinder(0.1, 1.5), half_space()));

TEST(Closest, SphereThroughWhoseCentreTheAxisGoes) {
  const Capsule link{{0, 0, 0}, {1, 0, 0}, 0.05, 0};
  const Closest c = closest(link, sphere(0.2), {Eigen::Matrix3d::Identity(), {0.5, 0, 0}});
  EXPECT_TRUE(c.degenerate);
  EXPECT_NEAR(c.normal.dot(Vector3d::UnitX()), 0, 1e-15);
  EXPECT_DOUBLE_EQ(c.distance_m, -0.25);
}

TEST(Closest, ParallelSegmentsMeetInTheMiddleOfTheirOverlap) {
  const Capsule link{{0, 0, 0}, {2, 0, 0}, 0, 0};
  const Eigen::Matrix3d along_x = Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitY()).toRotationMatrix();
  const Closest c = closest(link, capsule(0.1, 1), {along_x, {2, 0.5, 0}});
  EXPECT_NEAR(c.on_axis[0], 1.75, 1e-12);
  EXPECT_NEAR(c.distance_m, 0.4, 1e-12);
}

TEST(Closest, LinkLyingOverABoxMeetsInTheMiddle) {
  const Capsule link{{-1, 0, 0.5}, {1, 0, 0.5}, 0.1, 0};
  const Closest c = closest(link, box(0.6, 0.6, 0.2), {Eigen::Matrix3d::Identity(), {0.2, 0, 0}});
  EXPECT_NEAR(c.on_axis[0], 0.2, 1e-12);
  EXPECT_NEAR(c.distance_m, 0.3, 1e-12);
  EXPECT_FALSE(std::isfinite(c.centre_m));
}

TEST(Closest, NoLengthNoRadiusIsAPoint) {
  const Capsule point{{1, 2, 3}, {1, 2, 3}, 0, 0};
  for (const Shape& s : {sphere(0), capsule(0, 0), cylinder(0, 0), box(0, 0, 0), half_space()}) {
    const Closest here = closest(point, s, {Eigen::Matrix3d::Identity(), {1, 2, 3}});
    EXPECT_NEAR(here.distance_m, 0, 1e-15);
    EXPECT_NEAR(here.normal.norm(), 1, 1e-15);
    const Closest there = closest(point, s, {Eigen::Matrix3d::Identity(), {1, 2, 2}});
    EXPECT_NEAR(there.distance_m, 1, 1e-15);
    EXPECT_NEAR((there.normal - Vector3d(0, 0, -1)).norm(), 0, 1e-15);
  }
}

TEST(EnclosingCapsule, HoldsEveryPointOfTheShape) {
  Random r{std::mt19937_64{3}};
  for (const Shape& s : {box(0.2, 0.5, 0.1), box(0.3, 0.1, 0.1), cylinder(0.2, 0.6), cylinder(0.5, 0.1)}) {
    const Capsule c = enclosing_capsule(s);
    EXPECT_GT(c.excess_m, 0);
    for (int k = 0; k < 20000; ++k) {
      const Vector3d x = r.point(0.6);
      if (signed_distance(s, x) > 0) continue;
      const Vector3d d = c.p1 - c.p0;
      const double t = std::clamp((x - c.p0).dot(d) / d.squaredNorm(), 0.0, 1.0);
      ASSERT_LE((x - c.p0 - t * d).norm(), c.radius_m + 1e-12);
    }
  }
  EXPECT_EQ(enclosing_capsule(capsule(0.1, 0.4)).excess_m, 0);
}

}  // namespace
}  // namespace hamel::geometry
