#pragma once
/// When a planner cycle is due: the reduction `cycle` at run time.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/geometry/distance.h"
#include "common/rbd/rbd.h"
#include "common/scene/scene.h"

namespace hamel::scene {

/// Every PlannerOptions::period_steps-th step; where `cycle` made these fewer than written, also every
/// Hurry::period_steps-th at which a point of the arm is faster than Hurry::mps.
///
/// So two cycles are farther apart than as written only while no point of the arm is faster than that at
/// the start of any written period between them.  Depends on the state alone: whoever waits for a command and
/// whoever computes it ask about the same state and agree.
class Cadence {
 public:
  explicit Cadence(const Scene& s);

  /// `q`, `qd`: n [rad or m], [rad/s or m/s], at the step.  Not finite: due.  O(n + shapes) where `cycle` is
  /// in force, else O(1); no allocation.
  bool due(std::uint64_t step, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) noexcept;
  /// No point of the links' shapes, nor the end effector, is faster [m/s].  Of a body the fastest point of
  /// its capsule, the largest of |v + omega x p| over both ends plus |omega| radius.
  double fastest_mps(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) noexcept;

 private:
  struct Body {
    int link = 0;
    geometry::Capsule capsule_B;
  };
  std::uint64_t period_, hurry_;
  double hurry_mps_;
  model::Chain chain_;
  rbd::Workspace ws_;
  std::vector<Body> bodies_;
};

}  // namespace hamel::scene
