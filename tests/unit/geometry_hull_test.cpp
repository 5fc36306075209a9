// Capsules in place of other solids hold them, and reach no farther beyond them than they say.
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "common/geometry/hull.h"
#include "common/geometry/solid.h"
#include "tests/support/chains.h"

namespace hamel::geometry {
namespace {

using Eigen::Vector3d;

double distance(const Vector3d& x, const Capsule& c) {
  return closest(
             {x, x, 0, 0}, {ShapeKind::capsule, {c.radius_m, (c.p1 - c.p0).norm(), 0}},
             [&] {
               lie::Pose X;
               X.p = 0.5 * (c.p0 + c.p1);
               if (c.p0 != c.p1)
                 X.R = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), c.p1 - c.p0).toRotationMatrix();
               return X;
             }())
      .distance_m;
}

/// A point of the capsule's surface.
Vector3d surface(const Capsule& c, test::Random& rng) {
  const double along = std::clamp(rng.uniform(-0.3, 1.3), 0.0, 1.0);
  Vector3d out = rng.unit();
  const Vector3d axis = c.p1 - c.p0;
  if (along > 0 && along < 1 && !axis.isZero(0))
    out = (out - axis * (axis.dot(out) / axis.squaredNorm())).normalized();
  if ((along == 0 && axis.dot(out) > 0) || (along == 1 && axis.dot(out) < 0)) out = -out;
  return c.p0 + along * axis + c.radius_m * out;
}

/// Ratios of bounds over what was found, and how many half bounds were broken.
struct Tally {
  std::vector<double> ratios;
  int half_broken = 0;
  void add(double bound, double found) {
    EXPECT_LE(found, bound + 1e-9);
    if (bound > 1e-6) ratios.push_back(bound / std::max(found, 1e-12));
    half_broken += found > 0.5 * bound + 1e-9;
  }
  void judge() {
    ASSERT_GT(ratios.size(), 100u);
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    EXPECT_LT(*middle, 10) << "the bound says little";
    EXPECT_GT(half_broken, 0) << "half the bound would have been caught";
  }
};

/// A tree of spheres and capsules: near a line mostly.
std::vector<Capsule> tree(test::Random& rng) {
  std::vector<Capsule> out;
  const int n = 2 + static_cast<int>(rng.uniform(0, 6));
  const Vector3d from = rng.vec3(1), along = rng.unit() * rng.uniform(0, 0.15);
  const double jitter = rng.coin(0.5) ? 0 : rng.uniform(0, 0.02), radius = rng.uniform(0.02, 0.1);
  for (int k = 0; k < n; ++k) {
    const Vector3d p = from + k * along + rng.vec3(jitter), q = rng.coin(0.3) ? Vector3d(p + 0.7 * along) : p;
    out.push_back({p, q, rng.coin(0.5) ? radius : radius * rng.uniform(0.5, 1), 0});
  }
  return out;
}

TEST(Hull, HoldsItsMembersAndReachesNoFartherThanItSays) {
  test::Random rng(41);
  Tally tally;
  for (int k = 0; k < 1000; ++k) {
    const std::vector<Capsule> members = tree(rng);
    const Capsule c = hull(members);
    double found = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d x = surface(c, rng);
      double nearest = 1e9;
      for (const Capsule& m : members) nearest = std::min(nearest, distance(x, m));
      found = std::max(found, nearest);
      const Capsule& m = members[static_cast<std::size_t>(i) % members.size()];
      EXPECT_LE(distance(surface(m, rng), c), 1e-9);
    }
    tally.add(c.excess_m, found);
  }
  tally.judge();
}

TEST(Hull, OfEqualSpheresInARowIsTheRow) {
  const std::vector<Capsule> row{
      {{0, 0, 0}, {0, 0, 0}, 0.1, 0}, {{0, 0, 0.1}, {0, 0, 0.1}, 0.1, 0}, {{0, 0, 0.2}, {0, 0, 0.2}, 0.1, 0}};
  const Capsule c = hull(row);
  EXPECT_NEAR((c.p1 - c.p0).norm(), 0.2, 1e-15);
  EXPECT_DOUBLE_EQ(c.radius_m, 0.1);
  const double exact = std::hypot(0.05, 0.1) - 0.1;
  EXPECT_GE(c.excess_m, exact);
  EXPECT_LE(c.excess_m, 1.03 * exact);
}

TEST(TightCapsule, HoldsItsShapeAndReachesNoFartherThanItSays) {
  test::Random rng(43);
  Tally tally;
  for (int k = 0; k < 1000; ++k) {
    const Shape shape{rng.coin(0.5) ? ShapeKind::box : ShapeKind::cylinder,
                      {rng.uniform(0.01, 0.5), rng.uniform(0.01, 0.5), rng.uniform(0.01, 0.5)}};
    const Capsule c = tight_capsule(shape);
    EXPECT_LE(c.excess_m, enclosing_capsule(shape).excess_m + 1e-12);
    double found = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d x = surface(c, rng);
      const double d = closest({x, x, 0, 0}, shape, {}).distance_m;
      EXPECT_GE(d, -1e-9) << "the shape sticks out";
      found = std::max(found, d);
    }
    tally.add(c.excess_m, found);
  }
  tally.judge();
}

TEST(Group, KeepsToTheRoomOfEachAndFindsRows) {
  test::Random rng(47);
  for (int k = 0; k < 200; ++k) {
    std::vector<Capsule> members;
    std::vector<double> room;
    for (int i = 0; i < 30; ++i) {
      const Vector3d p = rng.vec3(0.2);
      members.push_back({p, p, rng.uniform(0.02, 0.1), 0});
      room.push_back(rng.uniform(1e-3, 3e-2));
    }
    const std::vector<std::size_t> first_of = group(members, room);
    for (std::size_t i = 0; i < members.size(); ++i) {
      std::vector<Capsule> chain;
      double least = 1;
      for (std::size_t j = i; j < members.size(); ++j)
        if (first_of[j] == i) chain.push_back(members[j]), least = std::min(least, room[j]);
      EXPECT_LE(first_of[i], i);
      if (chain.size() > 1) {
        EXPECT_LE(hull(chain).excess_m, least);
      }
    }
  }
  std::vector<Capsule> rows;
  for (int i = 0; i < 100; ++i) {
    const Vector3d p(0.01 * (i / 4), 0.5 * (i % 4), 0);
    rows.push_back({p, p, 0.05, 0});
  }
  std::vector<std::size_t> first_of = group(rows, std::vector<double>(100, 1e-3));
  std::sort(first_of.begin(), first_of.end());
  EXPECT_EQ(std::unique(first_of.begin(), first_of.end()) - first_of.begin(), 4);
}

}  // namespace
}  // namespace hamel::geometry
