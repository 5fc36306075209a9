#pragma once
/// The rivals on the dial: semi-implicit Euler and the classical Runge-Kutta method, in (q, qd).
///
/// Forward dynamics by the articulated-body sweep, damping and stops evaluated in it.  Work is summed with
/// the method's own weights.

#include "common/rbd/rbd.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// qdd(q, qd) of an arm under constant joint torque.
class Field {
 public:
  Field(const model::Chain& chain, const rbd::AxisChain& axis, double stop_stiffness);
  /// qdd and returns the power of torque, damping and stops [W].
  double operator()(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) noexcept;

 private:
  const model::Chain& chain_;
  const rbd::AxisChain& axis_;
  const double stop_stiffness_;
  rbd::Workspace ws_;
  VectorXd tau_;
};

/// qd' = qd + h qdd(q, qd), q' = q + h qd'.  Order 1.
class SemiImplicitEulerStep final : public TierStep {
 public:
  SemiImplicitEulerStep(const model::Chain& chain, const rbd::AxisChain& axis, const Options& options);
  std::size_t history_size() const noexcept override { return 0; }
  bool integrates_velocity() const noexcept override { return true; }
  StepReport advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept override;

 private:
  const rbd::AxisChain& axis_;
  Field field_;
  VectorXd q_, qd_, qdd_;
};

/// The classical four-stage Runge-Kutta method.  Order 4.
class Rk4Step final : public TierStep {
 public:
  Rk4Step(const model::Chain& chain, const rbd::AxisChain& axis, const Options& options);
  std::size_t history_size() const noexcept override { return 0; }
  bool integrates_velocity() const noexcept override { return true; }
  StepReport advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept override;

 private:
  const rbd::AxisChain& axis_;
  Field field_;
  VectorXd q_, qd_, qdd_, sum_q_, sum_qd_;
};

}  // namespace hamel::dynamics
