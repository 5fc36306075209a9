#pragma once
/// Bounded reductions of shape: links and obstacles grown to fewer and simpler solids.  While two solids do
/// not touch, the distance found is at most the true one and at least that less the bound.

#include <vector>

#include "common/scene/reach.h"
#include "common/scene/scene.h"

namespace hamel::scene {

/// Boxes and cylinders of the links become capsules, and capsules and spheres of one link (a sphere tree)
/// fewer capsules, wherever that reaches no more than `most_m` beyond them; only those that are watched
/// against the same shapes go together.  Robot::self_pairs follow.
/// @return the largest excess [m]; 0 where nothing changed
double simplify_shapes(Robot& robot, double most_m);

/// Obstacles of one set put together into fewer capsules, which have the smallest id of theirs.
///
/// Only spheres and capsules that stand, or drift without turning, all with the same known velocity and
/// sigma.  A group reaches at most `most_m` beyond its members; `most_m` D/rho0 where the arm, whatever it
/// does, stays farther from them than D > rho0: no force acts there, only the reported distance is off.
class Merge {
 public:
  Merge(double most_m, double rho0_m) : most_m_(most_m), rho0_m_(rho0_m) {}
  /// In place, keeping the order of the first ones.  O(obstacles^2), allocates: once a set.
  void apply(const Reach& reach, double horizon_s, std::vector<geometry::Obstacle>& set);
  /// Largest excess of the last apply() [m].
  double excess_m() const noexcept { return excess_m_; }

 private:
  double most_m_, rho0_m_, excess_m_ = 0;
};

}  // namespace hamel::scene
