#include "services/dynamics/core/midpoint.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {
namespace {

/// Implicit damping and stops up to this share of a joint's inertia are left to the iteration; above it the
/// mass matrix is factorised with them, once more a step.
constexpr double kExtraShare = 0.02;
/// Relative residual above which what a residual is measured by is not known yet.
constexpr double kFarOff = 1e-3;
/// A Jacobian that leaves more of the residual is made anew.
constexpr double kStale = 0.01;
/// Updates by feedback that cost more than the exact Jacobian and the updates it needs.
constexpr int kWorthNewton = 4;
/// A step in which feedback gains less a time is too long for the motion, whoever finds its root: it is for
/// feedback to fail, and the step to be divided.
constexpr double kResolved = 0.25;
/// After some steps by Newton feedback is tried again; a rate not seen for some steps is looked at again.
constexpr double kForget = 0.9, kAge = 1.25;

/// Torque of damping and stops.
double resistance(const rbd::JointNumbers& k, double rate, double stiffness, double q) {
  return (stiffness > 0 ? stop_torque(k, stiffness, q) : 0) - k.damping * rate;
}

}  // namespace

template <class G>
MidpointStep<G>::MidpointStep(const Chain& chain, const Options& options)
    : chain_(chain),
      options_(options),
      gravity_(std::sqrt(dot(chain.gravity_W, chain.gravity_W))),
      contraction_(chain.n()),
      d_(VectorXd::Zero(chain.n())),
      d_placed_(d_),
      r_(d_),
      p_next_(d_),
      scale_inv_(d_),
      extra_(d_),
      u_(d_),
      X_(at(chain.n())),
      X_factor_(at(chain.n())),
      own_factor_(at(chain.n())),
      V_(at(chain.n())),
      g_(at(chain.n())),
      push_(chain.n()),
      newton_(chain) {
  brakes_ = options.stop_stiffness > 0;
  for (const auto& k : chain.links) brakes_ = brakes_ || k.damping != 0;
}

template <class G>
void MidpointStep<G>::begin(const Node<G>& from, const Load<G>& load, double h) noexcept {
  from_ = &from, load_ = &load, h_ = h, rate_ = 1 / h;
  linearised_ = false, rescale_ = true, placed_ = false, feedback_ = {};
}

template <class G>
StepReport MidpointStep<G>::advance(const Node<G>& from, const Load<G>& load, double h,
                                    Node<G>& to) noexcept {
  begin(from, load, h);
  contraction_ = Contraction(chain_.n(), IncrementHistory::past(from, h));
  IncrementHistory::guess(from, h, d_);
  if (options_.root != Root::newton) choose_factorisation(d_);
  if (options_.start == Start::previous) d_.setZero();
  StepReport report = find_root(*this, options_, contraction_, d_);
  if (!report.usable()) return report;
  report.work_J = work(d_.data());
  IncrementHistory::push(from, h, remembered(), d_, to);
  to.q = from.q + d_;
  to.place(chain_, to.q);
  to.p.swap(p_next_);
  to.move_with_momentum(chain_);
  return report;
}

/// Of what acts on the joints, over the step.
template <class G>
double MidpointStep<G>::work(const double* d) const noexcept {
  const double *q = from_->q.data(), *tau = load_->tau.data(), *pushed = push_.data();
  double sum = 0;
  for (int i = 0; i < chain_.n(); ++i) sum += (tau[i] + pushed[i]) * d[i];
  for (int i = 0; brakes_ && i < chain_.n(); ++i)
    sum += resistance(chain_[i], d[i] * rate_, options_.stop_stiffness, q[i] + 0.5 * d[i]) * d[i];
  return sum;
}

/// The Jacobian is M/h plus, on the diagonal, damping/2 and h/4 times the stops' slope.
template <class G>
void MidpointStep<G>::choose_factorisation(const VectorXd& d) noexcept {
  frames_ = &from_->X, factor_ = &from_->factor;
  if (!brakes_) return;
  bool large = false;
  for (int i = 0; i < chain_.n(); ++i) {
    const double slope = stop_slope(chain_[i], options_.stop_stiffness, from_->q[i] + 0.5 * d[i]);
    extra_[i] = 0.5 * h_ * chain_[i].damping + 0.25 * h_ * h_ * slope;
    large = large || extra_[i] * from_->factor[at(i)].D_inv > kExtraShare;
  }
  if (!large) return;
  u_ = from_->q + 0.5 * d;
  rbd::place(chain_, u_.data(), X_factor_.data());
  rbd::factorise<G, double>(chain_, X_factor_.data(), extra_.data(), own_factor_.data());
  frames_ = &X_factor_, factor_ = &own_factor_;
}

/// Frames at q + d/2.  From one evaluation of a step to the next they change little.
template <class G>
void MidpointStep<G>::place(const double* d) noexcept {
  const double* q = from_->q.data();
  double* u = u_.data();
  for (int i = 0; i < chain_.n(); ++i) u[i] = q[i] + 0.5 * d[i];
  if constexpr (G::kPlanar) {
    double* placed = d_placed_.data();
    const auto change = [&](int i) { return 0.5 * (d[i] - std::exchange(placed[i], d[i])); };
    if (placed_ && rbd::turn_on(chain_, u, change, X_.data())) return;
    placed_ = true;
    std::copy_n(d, chain_.n(), placed);
  }
  rbd::place(chain_, u, X_.data());
}

template <class G>
void MidpointStep<G>::forward(const double* d) noexcept {
  place(d);
  Motion V;
  [[maybe_unused]] Direction g = chain_.gravity_W;
  const double rate = rate_;
  for (int i = 0; i < chain_.n(); ++i) {
    const auto& X = X_[at(i)];
    V = to_child(X, V);
    add_along(chain_[i], X, V, d[i] * rate);
    V_[at(i)] = V;
    if constexpr (!G::kPlanar) g_[at(i)] = g = turn_to_child(X, g);
  }
}

/// The torque over the step: commanded, damping by the mean rate, wrenches and stops at the midpoint.
template <class G>
Residual MidpointStep<G>::backward(const double* d) noexcept {
  Motion H;          // composite momentum
  Direction moment;  // composite first moment of mass: w_i = (moment x g, mass g)
  MomentumParts parts;
  // plain pointers and numbers of its own: this is where the time goes
  const double h = h_, half = 0.5 * h_, rate = rate_, stiffness = options_.stop_stiffness;
  const double quiet = kQuiet * chain_.energy_scale;
  const double *q = from_->q.data(), *p = from_->p.data(), *tau = load_->tau.data(), *pushed = push_.data();
  double *r = r_.data(), *p_next = p_next_.data(), *scale_inv = scale_inv_.data();
  const bool rescale = rescale_, brakes = brakes_;
  double largest = 0, relative = 0, poison = 0;  // of |r|
  for (int i = chain_.n(); i-- > 0;) {
    const auto& k = chain_[i];
    const auto& X = X_[at(i)];
    const Motion& V = V_[at(i)];
    H = H + momentum(k, X, V);
    add_moment(k, X, moment);
    const double brake = brakes ? resistance(k, d[i] * rate, stiffness, q[i] + 0.5 * d[i]) : 0;
    const double force = tau[i] + pushed[i] + brake;
    const double rotor = k.armature * d[i] * rate, push = half * force;
    const Direction& g = G::kPlanar ? chain_.gravity_W : g_[at(i)];
    const double turn = half * (coadjoint_along(k, X, V, H) + weight_along(k, X, moment, g));
    r[i] = along(k, X, H) + rotor - turn - p[i] - push;
    p_next[i] = p[i] + 2 * (turn + push);
    if (rescale) {
      parts.add(k, V);
      scale_inv[i] = 1 / (std::abs(p[i]) + parts.along(k) + std::abs(rotor) + std::abs(turn) +
                          std::abs(push) + h * (k.weight + quiet) + kNothing);
      parts.shift(X.p);
    }
    const double size = std::abs(r[i]);
    poison += size;
    largest = std::max(largest, size);
    relative = std::max(relative, size * scale_inv[i]);
    if (i == 0) break;
    H = to_parent(X, H);
    moment = moment_to_parent(k, X, moment);
  }
  if (!std::isfinite(poison)) return {poison, poison};
  rescale_ = relative > kFarOff;
  return {largest * rate, relative};
}

template <class G>
Residual MidpointStep<G>::evaluate(const VectorXd& d) noexcept {
  forward(d.data());
  push_.evaluate(chain_, X_, *load_);
  return backward(d.data());
}

template <class G>
bool MidpointStep<G>::newton_pays() const noexcept {
  return options_.root == Root::newton ||
         (options_.root == Root::adaptive &&
          (linearised_ || (contraction_.pace() < kResolved && contraction_.needs(kWorthNewton))));
}

/// Eq. (16): d <- d - h M^-1 r.  Newton: the exact Jacobian, made anew where the last one gains too
/// little.
template <class G>
void MidpointStep<G>::correct(VectorXd& d) noexcept {
  if (!newton_pays()) {
    double* increment = d.data();
    rbd::solve<G, double>(chain_, frames_->data(), factor_->data(), r_.data(), u_.data(),
                          [&, h = h_](int i, double x) { increment[i] -= h * x; });
    return;
  }
  if (!linearised_ || contraction_.rate() > kStale) {
    linearise_and_solve();
    if (!linearised_) feedback_ = {contraction_.seen(), contraction_.pace_seen()};
    contraction_.sharpen();
  } else {
    newton_.solve(r_.data(), r_.data());
  }
  linearised_ = true;
  d -= r_;
}

/// What the next step may expect, of feedback where there is a choice.  What was not seen in this one is
/// trusted a little less; what Newton spared us from seeing, a little more, until it is tried again.
template <class G>
Past MidpointStep<G>::remembered() const noexcept {
  const Past before = IncrementHistory::past(*from_, h_);
  if (linearised_ && options_.root == Root::adaptive)
    return {feedback_.rate > 0 ? feedback_.rate : kForget * before.rate,
            feedback_.pace > 0 ? feedback_.pace : kForget * before.pace};
  const double seen = contraction_.seen(), bound = contraction_.bound();
  return {seen > 0 ? std::min(1.0, std::max(seen, kForget * before.rate))
                   : std::min(bound > 0 ? bound : 1.0, kAge * before.rate),
          contraction_.pace_seen() > 0 ? contraction_.pace_seen() : before.pace};
}

template class MidpointStep<SE3>;
template class MidpointStep<SE2>;

}  // namespace hamel::dynamics
