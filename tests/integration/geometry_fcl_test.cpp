// Distances of every pair of shapes against FCL, skipping none.
#include <fcl/narrowphase/distance.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <random>

#include "clients/hamel/fcl_shapes.h"
#include "common/geometry/solid.h"

namespace hamel::geometry {
namespace {

using client::fcl_solid;
using client::fcl_transform;
using Eigen::Vector3d;

constexpr std::array kKinds{ShapeKind::sphere, ShapeKind::capsule, ShapeKind::cylinder, ShapeKind::box,
                            ShapeKind::half_space};

struct Random {
  std::mt19937_64 engine{20261122};
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
  }
  Shape shape(ShapeKind kind) {
    const double thin = (*this)(0, 1) < 0.1 ? 0.05 : 1;
    return {kind, Vector3d(thin * (*this)(0.02, 0.3), (*this)(0.02, 0.6), (*this)(0.02, 0.5))};
  }
  lie::Pose pose(double spread) {
    lie::Pose X;
    for (double& x : X.p) x = (*this)(-spread, spread);
    // A tenth stands along the axes: ties of faces and edges.
    if ((*this)(0, 1) < 0.1) return X;
    const Eigen::Quaterniond r((*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1));
    X.R = r.normalized().toRotationMatrix();
    return X;
  }
};

/// A pair of shapes as FCL sees it, the second one moved by a shift.
struct Oracle {
  Shape a, b;
  lie::Pose X_a, X_b;
  double distance() const {
    fcl::DistanceRequestd request;
    request.distance_tolerance = 1e-9;
    fcl::DistanceResultd result;
    return fcl::distance(fcl_solid(a).get(), fcl_transform(a, X_a), fcl_solid(b).get(), fcl_transform(b, X_b),
                         request, result);
  }
  bool together(const Vector3d& shift) const {
    fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    return fcl::collide(fcl_solid(a).get(), fcl_transform(a, X_a), fcl_solid(b).get(),
                        fcl_transform(b, {X_b.R, X_b.p + shift}), request, result) > 0;
  }
};

TEST(GeometryAgainstFcl, DistanceOfEveryPairAgrees) {
  Random random;
  int apart = 0, together = 0;
  double worst = 0;
  for (int k = 0; k < 10000; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Oracle o{random.shape(kKinds[i % 4]), random.shape(kKinds[i / 4 % 5]), random.pose(0.5),
                   random.pose(0.5)};
    const Closest c = closest(solid(o.a, o.X_a), solid(o.b, o.X_b));
    const std::string what =
        "pair " + std::to_string(k) + ": shapes " + std::to_string(k % 4) + ", " + std::to_string(k / 4 % 5);
    ASSERT_NEAR(c.normal.norm(), 1, 1e-9) << what;
    ASSERT_NEAR((c.on_link + c.distance_m * c.normal - c.on_obstacle).norm(), 0, 1e-9) << what;
    ASSERT_LE(distance_bound(solid(o.a, o.X_a), solid(o.b, o.X_b)), c.distance_m + 1e-9) << what;
    if (c.distance_m > 0) {
      ++apart;
      const double d = o.distance();
      worst = std::max(worst, std::abs(c.distance_m - d));
      ASSERT_NEAR(c.distance_m, d, 1e-6) << what;
    } else {
      ++together;
      ASSERT_TRUE(c.distance_m > -1e-6 || o.together(Vector3d::Zero())) << what << " " << c.distance_m;
    }
    // Moved apart by the depth they are apart; by less they are not.
    const bool of_axes = k % 4 >= 2 && k / 4 % 5 >= 2 && k / 4 % 5 <= 3;
    if (of_axes && c.distance_m < -1e-4) {
      ASSERT_FALSE(o.together((1e-6 - c.distance_m) * c.normal)) << what << " " << c.distance_m;
      ASSERT_TRUE(o.together(-0.99 * c.distance_m * c.normal)) << what << " " << c.distance_m;
    }
  }
  RecordProperty("apart", apart);
  RecordProperty("together", together);
  std::printf("apart %d, together %d, largest difference %.1e m\n", apart, together, worst);
  EXPECT_GT(apart, 3000);
  EXPECT_GT(together, 1000);
}

}  // namespace
}  // namespace hamel::geometry
