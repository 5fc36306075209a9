#pragma once
/// One step of an arm through time, by any tier of the dial between speed and accuracy.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/model/chain.h"
#include "common/scene/options.h"

namespace hamel::dynamics {

using Options = scene::DynamicsOptions;
using scene::Root;
using scene::Space;
using scene::Start;
using scene::Tier;

enum class Stop : std::uint8_t { converged, stagnated, budget_spent, diverged, explicit_step };

/// How a step went.  When not usable() the state was left untouched.
struct [[nodiscard]] StepReport {
  Stop stop = Stop::diverged;
  int iterations = 0;         ///< updates of the unknown
  int evaluations = 0;        ///< residual, stage or forward-dynamics evaluations
  int substeps = 1;           ///< parts the step was divided into
  double residual_Nm = 0;     ///< largest torque left unbalanced
  double work_J = 0;          ///< of joint torques, damping and stops over the step, as applied
  double energy_error_J = 0;  ///< change of E(q, p) beyond that work: what the method made up
  double made_up_J = 0;       ///< the sum of energy_error_J over all steps since start()
  int saturated = 0;          ///< joints whose torque was cut at their effort limit
  int beyond_limits =
      0;  ///< joints that end outside their position limits or faster than their velocity limit
  bool usable() const noexcept { return stop != Stop::diverged && stop != Stop::budget_spent; }
};

/// The arm at one time: all that is needed to go on exactly where it stopped (copy it, save it, load it).
struct State {
  std::uint64_t step = 0;
  Eigen::VectorXd q, p;         ///< configuration, discrete momentum; n each
  Eigen::VectorXd qd;           ///< M^-1 p, kept for those who look; tiers rk4, dopri8 integrate it
  std::vector<double> history;  ///< start guess and energy ledger; meaning known to the tier alone
};

/// An integrator bound to one chain and one set of options.  Not for two threads at once.
///
/// A planar chain (rbd::is_planar) is computed on SE(2): the same algorithms and, to rounding, the same
/// numbers in a fraction of the time; Options::space = se3 forbids it.
///
/// Guards.  A step is refused, or divided, when it does not converge, turns a joint absurdly far, or makes up
/// more than a tenth of the energy in play.  Tiers that promise to keep energy (midpoint, gauss) also keep a
/// ledger of what they made up in all their steps: beyond a quarter of the energy in play and the work
/// exchanged, steps that add to it are divided until they add a thousandth at most, and beyond a half they
/// are refused.
class Integrator {
 public:
  /// `options` must be valid (scene::problems()).  Allocates; nothing after it does.
  Integrator(const model::Chain& chain, const Options& options);
  ~Integrator();
  Integrator(Integrator&&) noexcept;

  /// The state at rest history from q0, qd0: p = M(q0) qd0.
  State start(const Eigen::VectorXd& q0, const Eigen::VectorXd& qd0) const;
  /// Advances by dt_s under joint torques `tau` (constant over the step), cut at the joints' effort limits.
  /// O(n) an evaluation.  No allocation, no throw, no lock.  On failure the state is untouched and the report
  /// says why.
  StepReport step(State& state, const Eigen::VectorXd& tau) noexcept;
  /// The torques of the last step as they acted; zero before the first.
  const Eigen::VectorXd& torque_applied() const noexcept;
  /// From now on a wrench acts on link `link` at its frame's origin: torque [N m] and force [N] in world
  /// axes, constant until set anew.  It enters like joint torque (a tier keeps its order with it) and its
  /// work is in the report.  Not part of State: who resumes sets it again.  False, and nothing changes,
  /// where a number is not finite.
  [[nodiscard]] bool set_wrench(int link, const lie::Wrench& F_W) noexcept;
  void clear_wrenches() noexcept;
  /// From now on the end effector holds a body, given in the end effector's axes; mass 0: none.  q and qd of
  /// `state` stay, its momentum becomes M qd of the laden arm.  Returns what is wrong with the body and
  /// changes nothing then. Allocates.  Not part of State: who resumes sets it again.
  Problems set_payload(const model::Inertia& body_E, State& state);
  /// q and qd at `share` in [0, 1] of the way between two states one step apart.  Tier gauss, step not
  /// divided: the collocation polynomials of q and p, error O(h^{s+1}) between the ends; else the cubic
  /// through q and qd at both ends, O(h^4).  No allocation; q and qd of size n.
  void between(const State& before, const State& after, double share, Eigen::VectorXd& q,
               Eigen::VectorXd& qd) noexcept;
  /// Torque that holds the arm against gravity at q.
  void gravity_torque(const Eigen::VectorXd& q, Eigen::VectorXd& tau_g) noexcept;
  /// E(q, p) [J].
  double energy(const State& state) noexcept;
  const model::Chain& chain() const noexcept;
  /// Where the arm is computed: se3, or automatic when the chain is planar and so on SE(2).
  Space space() const noexcept;
  const Options& options() const noexcept;

  class Impl;  ///< the arm on one of the groups

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace hamel::dynamics
