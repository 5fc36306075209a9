#pragma once
/// What every tier of the dial offers the integrator.

#include <Eigen/Core>
#include <limits>

#include "services/dynamics/core/integrator.h"
#include "services/dynamics/core/node.h"

namespace hamel::dynamics {

/// What acts on the arm over one step, constant in it.
template <class G>
struct Load {
  explicit Load(int n) : tau(VectorXd::Zero(n)), wrench(static_cast<std::size_t>(n)) {}
  VectorXd tau;         ///< joint torques
  Motions<G> wrench;    ///< on each link at its origin, in world axes (SE(2): the plane's)
  bool pushed = false;  ///< any wrench is not zero
};

/// Joint torques of a load's wrenches at one configuration; zero where there are none.
template <class G>
class Push {
 public:
  explicit Push(int n) : Q_(VectorXd::Zero(n)), R_(static_cast<std::size_t>(n)) {}
  void evaluate(const typename G::Chain& chain, const Frames<G>& X, const Load<G>& load) noexcept {
    if (load.pushed) {
      rbd::wrench_torques<G, double>(chain, X.data(), load.wrench.data(), R_.data(), Q_.data());
      acted_ = true;
    } else if (acted_) {
      Q_.setZero();
      acted_ = false;
    }
  }
  double operator[](int i) const noexcept { return Q_[i]; }
  const double* data() const noexcept { return Q_.data(); }

 private:
  VectorXd Q_;
  std::vector<typename G::template Attitude<double>> R_;
  bool acted_ = false;
};

/// One way to take a step.  All memory is taken in the constructor.
template <class G>
class TierStep {
 public:
  virtual ~TierStep() = default;
  /// Numbers of a state's history.
  virtual std::size_t history_size() const noexcept = 0;
  /// Which of p and qd the tier integrates: the other follows.
  virtual bool integrates_velocity() const noexcept { return false; }
  /// True when the tier promises to keep energy: then what it makes up is held against it over all its steps.
  virtual bool keeps_energy() const noexcept { return false; }
  /// A revolute joint may turn this much further in one undivided step than its velocity says: beyond it a
  /// low-order step is too long for the motion or its root is spurious [rad].
  virtual double turn_bound() const noexcept { return std::numeric_limits<double>::infinity(); }
  /// Iterations of a whole step after which no further part of it is begun: an adaptive tier divides by
  /// itself.
  virtual int budget() const noexcept { return std::numeric_limits<int>::max(); }
  /// One undivided step of h seconds, `from` to `to`, history included.  `to` means nothing when not
  /// usable().
  virtual StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept = 0;
  /// q and p `back` seconds before `end`, inside the step that led there; false when the tier keeps no
  /// polynomial.
  virtual bool interpolate(const Node<G>& end, double back, VectorXd& q, VectorXd& p) const noexcept {
    (void)end, (void)back, (void)q, (void)p;
    return false;
  }
};

/// Way beyond a limit over which the smooth hard stops grow stiff [rad or m].
inline constexpr double kStopWidth = 1e-3;
/// Torque of the smooth hard stops at q, e beyond a limit: stiffness e^2 / (e + kStopWidth), against it [N m
/// or N]. Continuous with its slope, which nowhere exceeds the stiffness; nothing inside the limits.
inline double stop_torque(const rbd::JointNumbers& k, double stiffness, double q) noexcept {
  const auto push = [&](double e) { return stiffness * (e * e / (e + kStopWidth)); };
  if (q > k.upper) return -push(q - k.upper);
  if (q < k.lower) return push(k.lower - q);
  return 0;
}
/// -d stop_torque / dq >= 0.
inline double stop_slope(const rbd::JointNumbers& k, double stiffness, double q) noexcept {
  const double e = q > k.upper ? q - k.upper : k.lower - q, r = kStopWidth / (e + kStopWidth);
  return e > 0 ? stiffness * (1 - r * r) : 0;
}

}  // namespace hamel::dynamics
