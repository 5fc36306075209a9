#include "services/dynamics/core/gauss.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace hamel::dynamics {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }
using Real = long double;

/// Legendre polynomial P_s and its slope at x in (-1, 1).
std::pair<Real, Real> legendre(int s, Real x) {
  Real before = 1, p = x;
  for (int k = 2; k <= s; ++k) {
    const Real next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
    before = p, p = next;
  }
  return {p, s * (x * p - before) / (x * x - 1)};
}

/// The j-th Lagrange polynomial over `nodes` at t.
Real lagrange(const std::vector<Real>& nodes, std::size_t j, Real t) {
  Real product = 1;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    if (k != j) product *= (t - nodes[k]) / (nodes[j] - nodes[k]);
  }
  return product;
}

}  // namespace

GaussMethod::GaussMethod(int stages) : c(stages), b(stages), a(stages, stages), extrapolate(stages, stages) {
  std::vector<Real> nodes, weights;
  for (int i = 0; i < stages; ++i) {
    Real x = -std::cos(std::numbers::pi_v<Real> * (i + 0.75L) / (stages + 0.5L));
    for (int k = 0; k < 50; ++k) x -= legendre(stages, x).first / legendre(stages, x).second;
    const Real slope = legendre(stages, x).second;
    nodes.push_back((1 + x) / 2);
    weights.push_back(1 / ((1 - x * x) * slope * slope));
  }
  for (int i = 0; i < stages; ++i) {
    c[i] = static_cast<double>(nodes[at(i)]);
    b[i] = static_cast<double>(weights[at(i)]);
    for (int j = 0; j < stages; ++j) {
      // the polynomial has degree s - 1: the method's own quadrature over [0, c_i] is exact
      Real integral = 0;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        integral += nodes[at(i)] * weights[k] * lagrange(nodes, at(j), nodes[at(i)] * nodes[k]);
      }
      a(i, j) = static_cast<double>(integral);
      extrapolate(i, j) = static_cast<double>(lagrange(nodes, at(j), 1 + nodes[at(i)]));
    }
  }
}

template <class G>
GaussStep<G>::GaussStep(const Chain& chain, const Options& options)
    : chain_(chain),
      options_(options),
      method_(options.stages),
      x_{MatrixXd::Zero(chain.n(), options.stages), MatrixXd::Zero(chain.n(), options.stages)},
      next_(x_),
      Q_(x_.V),
      P_(x_.V),
      inertia_(VectorXd::Zero(chain.n())),
      u_(inertia_),
      p_next_(inertia_),
      X_(at(chain.n())),
      factor_(at(chain.n())),
      momentum_(at(chain.n())),
      V_(at(chain.n())),
      g_(at(chain.n())),
      push_(chain.n()),
      pushed_(x_.V) {}

/// [h, V, F] of the last step; h = 0: none.
template <class G>
std::size_t GaussStep<G>::history_size() const noexcept {
  return 1 + static_cast<std::size_t>(2 * x_.V.size());
}

template <class G>
void GaussStep<G>::remember(const Stages& x, Node<G>& to) const noexcept {
  to.history[0] = h_;
  std::copy_n(x.V.data(), x.V.size(), to.history.data() + 1);
  std::copy_n(x.F.data(), x.F.size(), to.history.data() + 1 + x.V.size());
}

/// The last step's collocation polynomials carried on; the state at rest in its own velocity where there is
/// none.
template <class G>
void GaussStep<G>::guess(Stages& x) noexcept {
  const Eigen::Index n = x.V.rows(), s = x.V.cols();
  if (from_->history[0] != h_ || options_.start == Start::previous) {
    x.V.colwise() = from_->qd;
    x.F.setZero();
    return;
  }
  const Eigen::Map<const MatrixXd> V(from_->history.data() + 1, n, s), F(V.data() + V.size(), n, s);
  x.V.noalias() = V.lazyProduct(method_.extrapolate.transpose());
  x.F.noalias() = F.lazyProduct(method_.extrapolate.transpose());
}

template <class G>
double GaussStep<G>::force(int i, Eigen::Index j, double qd) const noexcept {
  const auto& k = chain_[i];
  double f = load_->tau[i] + pushed_(i, j) - k.damping * qd;
  if (options_.stop_stiffness > 0) f += stop_torque(k, options_.stop_stiffness, Q_(i, j));
  return f;
}

/// V = M(Q)^-1 P and F = dL/dq + joint torques at stage j.
template <class G>
void GaussStep<G>::evaluate_stage(Eigen::Index j) noexcept {
  auto g = chain_.gravity_W;
  rbd::place(chain_, Q_.col(j).data(), X_.data());
  for (int i = 0; i < chain_.n(); ++i) g_[at(i)] = g = turn_to_child(X_[at(i)], g);
  push_.evaluate(chain_, X_, *load_);
  rbd::factorise<G, double>(chain_, X_.data(), nullptr, factor_.data());
  double* const rate = next_.V.col(j).data();
  rbd::solve<G, double>(chain_, X_.data(), factor_.data(), P_.col(j).data(), u_.data(), rate);
  typename G::template Motion<double> V, H;
  for (int i = 0; i < chain_.n(); ++i) {
    V = to_child(X_[at(i)], V);
    add_along(chain_[i], X_[at(i)], V, rate[i]);
    V_[at(i)] = V;
    momentum_[at(i)] = momentum(chain_[i], X_[at(i)], V);
  }
  typename G::template Direction<double> moment;
  for (int i = chain_.n(); i-- > 0;) {
    const auto& k = chain_[i];
    const auto& X = X_[at(i)];
    H = H + momentum_[at(i)];
    add_moment(k, X, moment);
    pushed_(i, j) = push_[i];
    next_.F(i, j) =
        coadjoint_along(k, X, V_[at(i)], H) + weight_along(k, X, moment, g_[at(i)]) + force(i, j, rate[i]);
    H = to_parent(X, H);
    moment = moment_to_parent(k, X, moment);
  }
}

template <class G>
Residual GaussStep<G>::evaluate(const Stages& x) noexcept {
  Q_.noalias() = h_ * x.V.lazyProduct(method_.a.transpose());
  Q_.colwise() += from_->q;
  P_.noalias() = h_ * x.F.lazyProduct(method_.a.transpose());
  P_.colwise() += from_->p;
  Residual worst;
  for (Eigen::Index j = 0; j < x.V.cols(); ++j) {
    evaluate_stage(j);
    for (int i = 0; i < chain_.n(); ++i) {
      // mismatch and scale as momenta: a rate counts with the inertia it moves
      const double V = next_.V(i, j), F = next_.F(i, j), D = inertia_[i];
      const double mismatch = std::max(h_ * std::abs(F - x.F(i, j)), D * std::abs(V - x.V(i, j)));
      const double scale = std::abs(from_->p[i]) + std::abs(P_(i, j)) + D * std::abs(V) +
                           h_ * (std::abs(F) + chain_[i].weight) + std::numeric_limits<double>::min();
      if (!std::isfinite(V) || !std::isfinite(F)) return {V + F, V + F};
      worst.torque_Nm = std::max(worst.torque_Nm, mismatch / h_);
      worst.relative = std::max(worst.relative, mismatch / scale);
    }
  }
  return worst;
}

/// Fixed point: the stages that followed become the stages.
template <class G>
void GaussStep<G>::correct(Stages& x) noexcept {
  x.V.swap(next_.V);
  x.F.swap(next_.F);
}

template <class G>
StepReport GaussStep<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  from_ = &from, load_ = &load, h_ = h;
  for (int i = 0; i < chain_.n(); ++i) inertia_[i] = 1 / from.factor[at(i)].D_inv;
  guess(x_);
  StepReport report = find_root(*this, options_, x_);
  report.evaluations *= options_.stages;
  if (!report.usable()) return report;
  u_ = from.q, p_next_ = from.p;
  for (Eigen::Index j = 0; j < x_.V.cols(); ++j) {
    u_ += h * method_.b[j] * x_.V.col(j);
    p_next_ += h * method_.b[j] * x_.F.col(j);
    for (int i = 0; i < chain_.n(); ++i) {
      report.work_J += h * method_.b[j] * force(i, j, x_.V(i, j)) * x_.V(i, j);
    }
  }
  remember(x_, to);
  to.place(chain_, u_);
  to.move_with_momentum(chain_, p_next_);
  return report;
}

template class GaussStep<SE3>;
template class GaussStep<SE2>;

}  // namespace hamel::dynamics
