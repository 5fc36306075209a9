#pragma once
/// What every tier of the dial offers the integrator.

#include <Eigen/Core>

#include "services/dynamics/core/integrator.h"
#include "services/dynamics/core/node.h"

namespace hamel::dynamics {

/// One way to take a step.  All memory is taken in the constructor.
class TierStep {
 public:
  virtual ~TierStep() = default;
  /// Numbers of a state's history.
  virtual std::size_t history_size() const noexcept = 0;
  /// Which of p and qd the tier integrates: the other follows.
  virtual bool integrates_velocity() const noexcept { return false; }
  /// One undivided step of h seconds, `from` to `to`, history included.  `to` means nothing when not
  /// usable().
  virtual StepReport advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept = 0;
};

/// Torque of the smooth hard stops: nothing inside the limits, stiffness times excess outside [N m or N].
inline double stop_torque(const rbd::AxisLink& k, double stiffness, double q) noexcept {
  if (q > k.upper) return stiffness * (k.upper - q);
  if (q < k.lower) return stiffness * (k.lower - q);
  return 0;
}

}  // namespace hamel::dynamics
