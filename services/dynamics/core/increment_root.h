#pragma once
/// Finding the joint increments d = q^{k+1} - q^k of an implicit step: first guess, iteration, when to stop.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/lie/pack.h"
#include "services/dynamics/core/node.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// How fast an iteration converged when it was last seen; 0: not known.
struct Past {
  double rate = 0;  ///< the largest share of the residual that an update left
  double pace = 0;  ///< the same of two updates in a row, their mean: one alone may be luck
};

/// The past of an iteration, as it lies in State::history:
///   [count, h, rate, pace, then of every two joints, order by order, the last increments d and their
///    backward differences of order 1 .. kDepth - 1]; the last joint of an odd number stands beside zero.
/// It serves only steps of the same length h.
class IncrementHistory {
 public:
  static constexpr int kDepth = 10;
  static std::size_t size(int n) noexcept { return kHead + kBlock * static_cast<std::size_t>((n + 1) / 2); }

  /// First guess of the increment d: h qd while there is no past, else the polynomial through the last
  /// increments as a sum of backward differences, cut off where they stop falling: smooth motion gets a high
  /// order, rough motion a low one.
  template <class G>
  static void guess(const Node<G>& from, double h, VectorXd& increment) noexcept {
    const std::vector<double>& s = from.history;
    const Eigen::Index n = increment.size();
    const double *qd = from.qd.data(), *block = s.data() + kHead;
    double* d = increment.data();
    const int count = s[1] == h ? static_cast<int>(std::clamp(s[0], 0.0, double{kDepth})) : 0;
    if (count < 2) {  // h qd lies between the last increment and the one sought
      for (Eigen::Index i = 0; i < n; ++i)
        d[i] = count == 0 ? h * qd[i] : 2 * h * qd[i] - block[i / 2 * Eigen::Index{kBlock} + i % 2];
      return;
    }
    const int orders = falling(block, n, count);
    for (Eigen::Index i = 0; i < n; i += 2, block += kBlock) {
      Pair sum = Pair::load(block);
      for (int order = 1; order < orders; ++order) sum += Pair::load(block + 2 * order);
      if (i + 1 < n) {
        sum.store(d + i);
      } else {
        d[i] = sum.v[0];
      }
    }
  }
  template <class G>
  static Past past(const Node<G>& from, double h) noexcept {
    return from.history[1] == h ? Past{from.history[2], from.history[3]} : Past{};
  }
  /// Puts the increment in front of from's history and writes it to `to`.
  template <class G>
  static void push(const Node<G>& from, double h, const Past& past, const VectorXd& increment,
                   Node<G>& to) noexcept {
    const std::vector<double>& s = from.history;
    const Eigen::Index n = increment.size();
    const double count = s[1] == h ? s[0] : 0;
    to.history[0] = std::min<double>(count + 1, kDepth);
    to.history[1] = h, to.history[2] = past.rate, to.history[3] = past.pace;
    const double *last = s.data() + kHead, *d = increment.data();
    double* next = to.history.data() + kHead;
    for (Eigen::Index i = 0; i < n; i += 2, last += kBlock, next += kBlock) {
      Pair x = i + 1 < n ? Pair::load(d + i) : Pair{{d[i], 0}};
      for (int order = 0; order < kDepth; ++order) {
        x.store(next + 2 * order);
        x -= Pair::load(last + 2 * order);
      }
    }
  }

 private:
  using Pair = lie::Pack<2, lie::Baseline>;
  static constexpr std::size_t kHead = 4, kBlock = 2 * kDepth;

  /// How many orders to take.  What is left out is the error; as long as the past is short, its start may be
  /// in the differences.
  static int falling(const double* block, Eigen::Index n, int count) noexcept {
    std::array<Pair, kDepth> sizes;
    for (int order = 0; order < kDepth; ++order) sizes[at(order)] = abs(Pair::load(block + 2 * order));
    for (Eigen::Index i = 2; i < n; i += 2) {
      block += kBlock;
      for (int order = 0; order < kDepth; ++order) sizes[at(order)] += abs(Pair::load(block + 2 * order));
    }
    const auto size = [&](int order) { return sizes[at(order)].v[0] + sizes[at(order)].v[1]; };
    const double fall = count < kDepth ? 0.5 : 1;
    int orders = 1;
    while (orders < count && size(orders) < fall * size(orders - 1)) ++orders;
    return count == kDepth && orders < count ? std::max(orders - 1, 1) : orders;
  }
};

/// Turn bound of the tiers that find increments [rad].
inline constexpr double kTurnBound = 1.0;

/// Residual of one evaluation.
struct Residual {
  double torque_Nm = 0;  ///< largest |tau_e|
  double relative = 0;   ///< the same against the momenta and torques that make it up
};

/// Relative residual that counts as rounding for a few links; sums along many links round more.
inline constexpr double kRounding = 2 * std::numeric_limits<double>::epsilon();
/// So many roundings from the end, an update that gains much less than others did means that rounding is
/// reached: it left more than kIdle, and kWorse times what the best one left ...
inline constexpr double kFloor = 500;
inline constexpr double kIdle = 0.3, kWorse = 4;
/// ... and below which several updates in a row without progress do: slow convergence is not stagnation.
inline constexpr double kHighFloor = 1e-9;
inline constexpr int kPatience = 3;
/// Growth over the first residual that means divergence.
inline constexpr double kGrowth = 1e6;

/// How fast an iteration converges: the largest share of the residual that an update left.  Parts of the
/// error that fall slowly are not seen before the others are gone, so what past steps saw counts as well.
class Contraction {
 public:
  /// For a chain of n joints; `past`: what past steps saw.
  explicit Contraction(int n, const Past& past = {})
      : rounding_(kRounding * std::max(1.0, 0.125 * n)),
        rate_(past.rate),
        pace_(past.pace),
        known_(past.rate > 0) {}
  void see(double relative) noexcept {
    if (last_ > 0 && (last_ > kClear * rounding_ || rate_ == 0)) {
      known_ = known_ || seen_ > 0;
      seen_ = std::max(seen_, relative / last_);
      rate_ = std::max(rate_, seen_);
      if (before_ > 0) pace_seen_ = std::max(pace_seen_, std::sqrt(relative / before_));
      pace_ = std::max(pace_, pace_seen_);
    } else if (last_ > 0) {
      bound_ = std::max(bound_, relative / last_);
    }
    before_ = last_, last_ = relative;
  }
  /// For an equation whose residual is already what the next update leaves.
  void look_no_further() noexcept { least_ = std::numeric_limits<double>::infinity(); }
  /// From now on updates are made by an exact Jacobian: what others left says nothing.
  void sharpen() noexcept { rate_ = seen_ = 0, known_ = true, least_ = kLeastExact; }
  /// 0: not known.
  double rate() const noexcept { return rate_; }
  /// The largest in this step; 0: none was seen.
  double seen() const noexcept { return seen_; }
  /// The same of two updates in a row.
  double pace() const noexcept { return pace_; }
  double pace_seen() const noexcept { return pace_seen_; }
  /// The same where rounding hides it: it was no more; 0: nothing is known.
  double bound() const noexcept { return bound_; }
  bool done() const noexcept { return within(1); }
  /// So many roundings from the end.
  bool within(double roundings) const noexcept { return last_ <= roundings * rounding_; }
  /// One more update leaves nothing to see.
  bool ends_next() const noexcept {
    return known_ && rate_ > 0 && rate_ < 1 && last_ * std::max(rate_, least_) <= rounding_;
  }
  /// At this pace so many updates are needed, or more; false when it is not known.
  bool needs(int updates) const noexcept {
    double left = last_;
    for (int k = 1; k < updates; ++k) left *= pace_;
    return pace_ > 0 && left > rounding_;
  }

 private:
  static constexpr double kClear = 100;  ///< a residual so much above rounding is known well
  /// No update is trusted to leave less, for motion changes from step to step; and the momentum handed on is
  /// that of the last evaluation, which must not be far from the root.
  static constexpr double kLeast = 1e-3, kLeastExact = 1e-4;
  double rounding_, rate_, pace_, seen_ = 0, pace_seen_ = 0, bound_ = 0, before_ = 0, last_ = 0,
                                  least_ = kLeast;
  bool known_;
};

/// Updates the unknown until the equation holds.  Equation: Residual evaluate(x), void correct(x) (x -= J^-1
/// r).  With the scaled tolerance the last update is not looked at when the one before it leaves no doubt:
/// the last evaluation is then at an x that differs by less than a rounding error over `contraction`'s rate,
/// and residual_Nm is what is expected.
template <class Equation, class Unknown>
StepReport find_root(Equation& equation, const Options& options, Contraction& contraction,
                     Unknown& x) noexcept {
  StepReport report;
  double first = 0, last = 0, best = std::numeric_limits<double>::infinity(), best_rate = 1;
  int since_best = 0;
  for (;;) {
    const Residual r = equation.evaluate(x);
    ++report.evaluations;
    report.residual_Nm = r.torque_Nm;
    if (!std::isfinite(r.torque_Nm) || !std::isfinite(r.relative)) return report;
    contraction.see(r.relative);
    if (options.tolerance_Nm > 0 ? r.torque_Nm < options.tolerance_Nm : contraction.done()) {
      report.stop = Stop::converged;
      return report;
    }
    if (report.evaluations == 1) {
      first = r.relative;
    } else {
      const double rate = r.relative / last;
      if (contraction.within(kFloor) && rate > kIdle && rate > kWorse * best_rate) {
        report.stop = Stop::stagnated;
        return report;
      }
      best_rate = std::min(best_rate, rate);
    }
    last = r.relative;
    since_best = r.relative < best ? 0 : since_best + 1;
    if (r.relative < kHighFloor && since_best >= kPatience) {
      report.stop = Stop::stagnated;
      return report;
    }
    if (r.relative > kGrowth * first) return report;
    if (report.iterations == options.max_iterations) {
      report.stop = Stop::budget_spent;
      return report;
    }
    best = std::min(best, r.relative);
    const bool ends = !(options.tolerance_Nm > 0) && contraction.ends_next();
    equation.correct(x);
    ++report.iterations;
    if (ends) {
      report.residual_Nm *= std::min(1.0, contraction.rate());
      report.stop = Stop::converged;
      return report;
    }
  }
}

}  // namespace hamel::dynamics
