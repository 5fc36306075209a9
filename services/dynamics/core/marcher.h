#pragma once
/// A whole step of an arm by one tier: guards, energy ledger, division of steps that fail.

#include <memory>

#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// What a tier made up in all its steps, and the work that was exchanged meanwhile [J].  Kept at the end of a
/// state's history.
struct Ledger {
  static constexpr std::size_t kSize = 2;
  double made_up = 0, exchanged = 0;
};

template <class G>
class Marcher {
 public:
  using Chain = typename G::Chain;
  Marcher(const Chain& chain, const Options& options, std::unique_ptr<TierStep<G>> tier);
  Marcher(const Marcher&) = delete;
  Marcher& operator=(const Marcher&) = delete;

  State start(const VectorXd& q0, const VectorXd& qd0) const;
  /// Integrator::step(), torques cut already.
  StepReport step(State& s, const Load<G>& load) noexcept;
  /// Not a number for a state that is none.
  double energy(const State& s) noexcept;
  /// The chain has got other inertias: p follows from q and qd.
  void reweigh(State& s) noexcept;
  /// Integrator::between().
  void between(const State& before, const State& after, double share, VectorXd& q, VectorXd& qd) noexcept;

 private:
  bool load(const State& s) noexcept;
  bool fits(const State& s) const noexcept;
  bool holds(const State& s) const noexcept;
  bool acceptable(const State& s) const noexcept;
  void store(State& s) const noexcept;
  bool sane(const StepReport& report, const Load<G>& load, double h) const noexcept;
  bool allowed(double made_up, double in_play) const noexcept;
  StepReport advance(const Load<G>& load, double h) noexcept;
  StepReport march(const Load<G>& load) noexcept;

  const Chain& chain_;
  const Options& options_;
  std::unique_ptr<TierStep<G>> tier_;
  Node<G> nodes_[2];
  Node<G>*now_ = &nodes_[0], *next_ = &nodes_[1];
  VectorXd q_, p_;  ///< scratch
  Ledger ledger_;
  bool loaded_ = false;
};

}  // namespace hamel::dynamics
