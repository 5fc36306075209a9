#include "services/dynamics/core/midpoint.h"

#include <algorithm>
#include <cmath>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {
namespace {

/// Implicit damping and stops up to this share of a joint's inertia are left to the iteration; above it the
/// mass matrix is factorised with them, once more a step.
constexpr double kExtraShare = 0.02;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

template <class G>
MidpointStep<G>::MidpointStep(const Chain& chain, const Options& options)
    : chain_(chain),
      options_(options),
      history_(chain.n()),
      d_(VectorXd::Zero(chain.n())),
      r_(d_),
      p_next_(d_),
      extra_(d_),
      u_(d_),
      X_(at(chain.n())),
      X_factor_(at(chain.n())),
      own_factor_(at(chain.n())),
      V_(at(chain.n())),
      momentum_(at(chain.n())),
      H_(at(chain.n())),
      g_(at(chain.n())),
      moment_(at(chain.n())),
      push_(chain.n()),
      newton_(chain) {}

template <class G>
void MidpointStep<G>::begin(const Node<G>& from, const Load<G>& load, double h) noexcept {
  from_ = &from, load_ = &load, h_ = h;
  linearised_ = false;
}

template <class G>
StepReport MidpointStep<G>::advance(const Node<G>& from, const Load<G>& load, double h,
                                    Node<G>& to) noexcept {
  begin(from, load, h);
  history_.guess(from, h, d_);
  if (options_.root == Root::feedback) choose_factorisation(d_);
  if (options_.start == Start::previous) d_.setZero();
  StepReport report = find_root(*this, options_, d_);
  if (!report.usable()) return report;
  for (int i = 0; i < chain_.n(); ++i) report.work_J += force(i, d_[i]) * d_[i];
  IncrementHistory::push(from, h, d_, to);
  u_ = from.q + d_;
  to.place(chain_, u_);
  to.move_with_momentum(chain_, p_next_);
  return report;
}

/// Joint torque over the step: commanded, damping by the mean rate, wrenches and stops at the midpoint.
template <class G>
[[gnu::always_inline]] inline double MidpointStep<G>::force(int i, double d) const noexcept {
  const auto& k = chain_[i];
  double f = load_->tau[i] + push_[i] - k.damping * d / h_;
  if (options_.stop_stiffness > 0) f += stop_torque(k, options_.stop_stiffness, from_->q[i] + 0.5 * d);
  return f;
}

/// The Jacobian is M/h plus, on the diagonal, damping/2 and h/4 times the stops' slope.
template <class G>
void MidpointStep<G>::choose_factorisation(const VectorXd& d) noexcept {
  frames_ = &from_->X, factor_ = &from_->factor;
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

template <class G>
void MidpointStep<G>::forward(const VectorXd& d) noexcept {
  u_ = from_->q + 0.5 * d;
  rbd::place(chain_, u_.data(), X_.data());
  typename G::template Motion<double> V;
  auto g = chain_.gravity_W;
  const double rate = 1 / h_;
  for (int i = 0; i < chain_.n(); ++i) {
    const auto& X = X_[at(i)];
    V = to_child(X, V);
    add_along(chain_[i], X, V, d[i] * rate);
    V_[at(i)] = V;
    momentum_[at(i)] = momentum(chain_[i], X, V);
    g_[at(i)] = g = turn_to_child(X, g);
  }
}

template <class G>
Residual MidpointStep<G>::backward(const VectorXd& d) noexcept {
  typename G::template Motion<double> H;  // composite momentum
  typename G::template Direction<double>
      moment;  // composite first moment of mass: w_i = (moment x g, mass g)
  MomentumParts parts;
  const double rate = 1 / h_, half = 0.5 * h_;
  double largest = 0, poison = 0, worst_size = 0, worst_scale = 1;  // of |r|; the worst by its scale
  for (int i = chain_.n(); i-- > 0;) {
    const auto& k = chain_[i];
    const auto& X = X_[at(i)];
    H = H + momentum_[at(i)];
    parts.add(k, V_[at(i)]);
    add_moment(k, X, moment);
    H_[at(i)] = H;
    moment_[at(i)] = moment;
    const double rotor = k.armature * d[i] * rate;
    const double p = along(k, X, H) + rotor;
    const double turn = half * (coadjoint_along(k, X, V_[at(i)], H) + weight_along(k, X, moment, g_[at(i)]));
    const double push = half * force(i, d[i]);
    r_[i] = p - turn - from_->p[i] - push;
    p_next_[i] = p + turn + push;
    const double scale = std::abs(from_->p[i]) + parts.along(k) + std::abs(rotor) + std::abs(turn) +
                         std::abs(push) + h_ * (k.weight + kQuiet * chain_.energy_scale) + kNothing;
    const double size = std::abs(r_[i]);
    poison += size;
    largest = std::max(largest, size);
    const bool worse = size * worst_scale > worst_size * scale;
    worst_size = worse ? size : worst_size, worst_scale = worse ? scale : worst_scale;
    if (i == 0) break;
    H = to_parent(X, H);
    parts.shift(X.p);
    moment = moment_to_parent(k, X, moment);
  }
  if (!std::isfinite(poison)) return {poison, poison};
  return {largest * rate, worst_size / worst_scale};
}

template <class G>
Residual MidpointStep<G>::evaluate(const VectorXd& d) noexcept {
  forward(d);
  push_.evaluate(chain_, X_, *load_);
  const Residual r = backward(d);
  relative_ = r.relative;
  return r;
}

template <class G>
void MidpointStep<G>::linearise(const VectorXd& d) noexcept {
  for (int i = 0; i < chain_.n(); ++i) newton_.rows()[at(i)] = row(i, d[i]);
  newton_.factorise(X_);
}

/// Eq. (16): d <- d - h M^-1 r.  Newton: the exact Jacobian, made anew where the last one no longer gains a
/// factor of ten a time.
template <class G>
void MidpointStep<G>::correct(VectorXd& d) noexcept {
  if (options_.root == Root::feedback) {
    rbd::solve<G, double>(chain_, frames_->data(), factor_->data(), r_.data(), u_.data(), r_.data());
    d -= h_ * r_;
    return;
  }
  if (!linearised_ || relative_ > 0.1 * relative_at_correction_) linearise(d);
  linearised_ = true;
  relative_at_correction_ = relative_;
  newton_.solve(r_.data(), r_.data());
  d -= r_;
}

template class MidpointStep<SE3>;
template class MidpointStep<SE2>;

}  // namespace hamel::dynamics
