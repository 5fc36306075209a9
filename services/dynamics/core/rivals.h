#pragma once
/// The rivals on the dial: semi-implicit Euler and the classical Runge-Kutta method, in (q, qd).
///
/// Forward dynamics by the articulated-body sweep, damping and stops evaluated in it.  Work is summed with
/// the method's own weights.

#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// qdd(q, qd) of an arm under a constant load.
template <class G>
class Field {
 public:
  Field(const typename G::Chain& chain, double stop_stiffness);
  /// qdd and returns the power of torque, wrenches, damping and stops [W].
  double operator()(const VectorXd& q, const VectorXd& qd, const Load<G>& load, VectorXd& qdd) noexcept;

  /// Torque, wrenches and stops of the last evaluation [N m or N].
  const VectorXd& torque() const noexcept { return tau_; }

 private:
  const typename G::Chain& chain_;
  const double stop_stiffness_;
  rbd::Sweep<G> sweep_;
  Push<G> push_;
  VectorXd tau_;
};

/// qd' = qd + h qdd(q, qd), q' = q + h qd'.  Order 1.
template <class G>
class SemiImplicitEulerStep final : public TierStep<G> {
 public:
  SemiImplicitEulerStep(const typename G::Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return 0; }
  bool integrates_velocity() const noexcept override { return true; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

 private:
  const typename G::Chain& chain_;
  Field<G> field_;
  VectorXd q_, qd_, qdd_;
};

/// The classical four-stage Runge-Kutta method.  Order 4.
template <class G>
class Rk4Step final : public TierStep<G> {
 public:
  Rk4Step(const typename G::Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return 0; }
  bool integrates_velocity() const noexcept override { return true; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

 private:
  const typename G::Chain& chain_;
  Field<G> field_;
  VectorXd q_, qd_, qdd_, sum_q_, sum_qd_;
};

}  // namespace hamel::dynamics
