#pragma once
/// Tier `dopri8`: the adaptive Runge-Kutta method of order 8 with error estimates of orders 5 and 3 in (q,
/// qd). [Prince, Dormand 1981; coefficients and step control: Hairer, Norsett, Wanner 1993, II.5, II.10]
///
/// dt_s is the time between outputs; inside it the method chooses its own steps by tolerance_rel, which
/// counts against max(|q|, 1 rad) and max(|qd|, 1 rad/s).  StepReport::iterations counts those steps, refused
/// ones included; after kMaxSteps of them an output interval is given up (budget_spent).

#include <array>

#include "services/dynamics/core/rivals.h"

namespace hamel::dynamics {

/// The method's table: twelve stages, the thirteenth is the next step's first.
struct Dop853 {
  static constexpr int kStages = 12;
  static const std::array<double, kStages> c, b, error5, error3;
  static const std::array<std::array<double, kStages>, kStages> a;
};

/// The method's own steps in one output interval, at most.
inline constexpr int kMaxSteps = 5000;

template <class G>
class Dopri8Step final : public TierStep<G> {
 public:
  Dopri8Step(const typename G::Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return 1; }  ///< the step it would take next [s]
  bool integrates_velocity() const noexcept override { return true; }
  int budget() const noexcept override { return kMaxSteps; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

 private:
  double try_step(double h, const Load<G>& load) noexcept;
  double first_step(double h) const noexcept;

  const typename G::Chain& chain_;
  const double tolerance_;
  Field<G> field_;
  VectorXd q_, qd_, q_new_, qd_new_;
  std::array<VectorXd, Dop853::kStages> rate_, acceleration_;  ///< qd and qdd at the stages
  std::array<double, Dop853::kStages> power_{};
};

}  // namespace hamel::dynamics
