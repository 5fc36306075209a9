#pragma once
/// Finding the joint increments d = q^{k+1} - q^k of an implicit step: first guess, iteration, when to stop.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "services/dynamics/core/node.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// The last increments, newest first, as they lie in State::history: [count, h, d_k (n), d_{k-1} (n), ...].
/// They serve only steps of the same length h.
class IncrementHistory {
 public:
  static constexpr int kDepth = 7;
  static std::size_t size(int n) noexcept { return 2 + static_cast<std::size_t>(kDepth * n); }

  explicit IncrementHistory(int n) : difference_(static_cast<std::size_t>(kDepth * n)) {}

  /// First guess of d: h qd while there is no past, else the polynomial through the last increments as a sum
  /// of backward differences, cut off where they stop falling: smooth motion gets a high order, rough motion
  /// a low one.
  template <class G>
  void guess(const Node<G>& from, double h, VectorXd& d) noexcept {
    const std::vector<double>& s = from.history;
    const Eigen::Index n = d.size();
    const int count = s[1] == h ? static_cast<int>(s[0]) : 0;
    d = h * from.qd;
    if (count == 0) return;
    const double* last = s.data() + 2;
    if (count == 1) {  // h qd lies between the two increments
      for (Eigen::Index i = 0; i < n; ++i) d[i] = 2 * d[i] - last[i];
      return;
    }
    // the newest differences lie in front: one flat subtraction an order
    double* v = difference_.data();
    std::copy_n(last, count * n, v);
    std::copy_n(v, n, d.data());
    double before = size_of(v, n);
    for (Eigen::Index left = (count - 1) * n; left > 0; left -= n) {
      for (Eigen::Index j = 0; j < left; ++j) v[j] -= v[j + n];
      const double size = size_of(v, n);
      if (size >= 0.5 * before) return;
      for (Eigen::Index i = 0; i < n; ++i) d[i] += v[i];
      before = size;
    }
  }

  /// Puts d in front of from's history and writes it to `to`.
  template <class G>
  static void push(const Node<G>& from, double h, const VectorXd& d, Node<G>& to) noexcept {
    const std::vector<double>& s = from.history;
    const Eigen::Index n = d.size();
    const double count = s[1] == h ? s[0] : 0;
    to.history[0] = std::min<double>(count + 1, kDepth);
    to.history[1] = h;
    std::copy(s.begin() + 2, s.end() - n, to.history.begin() + 2 + n);
    Eigen::Map<VectorXd>(to.history.data() + 2, n) = d;
  }

 private:
  static double size_of(const double* v, Eigen::Index n) noexcept {
    double size = 0;
    for (Eigen::Index i = 0; i < n; ++i) size += std::abs(v[i]);
    return size;
  }
  std::vector<double> difference_;
};

/// Turn bound of the tiers that find increments [rad].
inline constexpr double kTurnBound = 1.0;

/// Residual of one evaluation.
struct Residual {
  double torque_Nm = 0;  ///< largest |tau_e|
  double relative = 0;   ///< the same against the momenta and torques that make it up
};

/// Relative residual that counts as rounding: reached, the iteration stops.
inline constexpr double kRounding = 2 * std::numeric_limits<double>::epsilon();
/// Relative residual below which one look without progress means that rounding is reached ...
inline constexpr double kFloor = 1e-12;
/// ... and below which several in a row do: slow convergence is not stagnation.
inline constexpr double kHighFloor = 1e-9;
inline constexpr int kPatience = 3;
/// Growth over the first residual that means divergence.
inline constexpr double kGrowth = 1e6;

/// Updates the unknown until the equation holds.  Equation: Residual evaluate(x), void correct(x) (x -= J^-1
/// r). The last call to evaluate() is at the x that is returned.
template <class Equation, class Unknown>
StepReport find_root(Equation& equation, const Options& options, Unknown& x) noexcept {
  StepReport report;
  double first = 0, best = std::numeric_limits<double>::infinity();
  int since_best = 0;
  for (;;) {
    const Residual r = equation.evaluate(x);
    ++report.evaluations;
    report.residual_Nm = r.torque_Nm;
    if (!std::isfinite(r.torque_Nm) || !std::isfinite(r.relative)) return report;
    if (options.tolerance_Nm > 0 ? r.torque_Nm < options.tolerance_Nm : r.relative <= kRounding) {
      report.stop = Stop::converged;
      return report;
    }
    since_best = r.relative < best ? 0 : since_best + 1;
    if ((r.relative < kFloor && r.relative > 0.5 * best) ||
        (r.relative < kHighFloor && since_best >= kPatience)) {
      report.stop = Stop::stagnated;
      return report;
    }
    if (report.evaluations == 1) first = r.relative;
    if (r.relative > kGrowth * first) return report;
    if (report.iterations == options.max_iterations) {
      report.stop = Stop::budget_spent;
      return report;
    }
    best = std::min(best, r.relative);
    equation.correct(x);
    ++report.iterations;
  }
}

}  // namespace hamel::dynamics
