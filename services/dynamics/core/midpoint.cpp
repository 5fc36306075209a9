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

MidpointStep::MidpointStep(const rbd::AxisChain& chain, const Options& options)
    : chain_(chain),
      options_(options),
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
      newton_(chain) {}

void MidpointStep::begin(const Node& from, const VectorXd& tau, double h) noexcept {
  from_ = &from, tau_ = &tau, h_ = h;
  linearised_ = false;
}

StepReport MidpointStep::advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept {
  begin(from, tau, h);
  IncrementHistory::guess(from, h, d_);
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

/// Joint torque over the step: commanded, damping by the mean rate, stops at the midpoint.
double MidpointStep::force(int i, double d) const noexcept {
  const rbd::AxisLink& k = chain_[i];
  double f = (*tau_)[i] - k.damping * d / h_;
  if (options_.stop_stiffness > 0) f += stop_torque(k, options_.stop_stiffness, from_->q[i] + 0.5 * d);
  return f;
}

/// The Jacobian is M/h plus, on the diagonal, damping/2 and h stiffness/4 of stops that act.
void MidpointStep::choose_factorisation(const VectorXd& d) noexcept {
  poses_ = &from_->X, factor_ = &from_->factor;
  bool large = false;
  for (int i = 0; i < chain_.n(); ++i) {
    const bool stopped = stop_torque(chain_[i], options_.stop_stiffness, from_->q[i] + 0.5 * d[i]) != 0;
    extra_[i] = 0.5 * h_ * chain_[i].damping + (stopped ? 0.25 * h_ * h_ * options_.stop_stiffness : 0);
    large = large || extra_[i] * from_->factor[at(i)].D_inv > kExtraShare;
  }
  if (!large) return;
  for (int i = 0; i < chain_.n(); ++i) X_factor_[at(i)] = rbd::pose_at(chain_[i], from_->q[i] + 0.5 * d[i]);
  rbd::factorise(chain_, X_factor_.data(), extra_.data(), own_factor_.data());
  poses_ = &X_factor_, factor_ = &own_factor_;
}

void MidpointStep::forward(const VectorXd& d) noexcept {
  rbd::Half6<double> V;
  lie::Vec3<double> g = chain_.gravity_W;
  for (int i = 0; i < chain_.n(); ++i) {
    const rbd::AxisLink& k = chain_[i];
    const rbd::LinkPose<double>& X = X_[at(i)] = rbd::pose_at(k, from_->q[i] + 0.5 * d[i]);
    V = to_child(X, V);
    along(k, V) += d[i] / h_;
    V_[at(i)] = V;
    momentum_[at(i)] = momentum(k, V);
    g_[at(i)] = g = transpose_times(X.R, g);
  }
}

Residual MidpointStep::backward(const VectorXd& d) noexcept {
  Residual worst;
  rbd::Half6<double> H;      // composite momentum
  lie::Vec3<double> moment;  // composite first moment of mass: w_i = (moment x g, mass g)
  MomentumParts parts;
  for (int i = chain_.n(); i-- > 0;) {
    const rbd::AxisLink& k = chain_[i];
    const lie::Vec3<double>& g = g_[at(i)];
    H = H + momentum_[at(i)];
    parts.add(k, V_[at(i)]);
    moment += k.h;
    H_[at(i)] = H;
    moment_[at(i)] = moment;
    const double weight = k.prismatic ? k.outer_mass * g.z : moment.x * g.y - moment.y * g.x;
    const double p = along(k, H) + k.armature * d[i] / h_;
    const double turn = 0.5 * h_ * (coadjoint_along(k, V_[at(i)], H) + weight);
    const double push = 0.5 * h_ * force(i, d[i]);
    r_[i] = p - turn - from_->p[i] - push;
    p_next_[i] = p + turn + push;
    const double scale = std::abs(from_->p[i]) + parts.along(k) + k.armature * std::abs(d[i]) / h_ + std::abs(turn) +
                         std::abs(push) + h_ * k.weight + std::numeric_limits<double>::min();
    if (!std::isfinite(r_[i])) return {r_[i], r_[i]};
    worst.torque_Nm = std::max(worst.torque_Nm, std::abs(r_[i]) / h_);
    worst.relative = std::max(worst.relative, std::abs(r_[i]) / scale);
    if (i == 0) break;
    const rbd::LinkPose<double>& X = X_[at(i)];
    H = to_parent(X, H);
    parts.shift(X.p);
    moment = X.R * moment + k.outer_mass * X.p;
  }
  return worst;
}

Residual MidpointStep::evaluate(const VectorXd& d) noexcept {
  forward(d);
  const Residual r = backward(d);
  relative_ = r.relative;
  return r;
}

/// One joint of the exact Jacobian.  With B = A/h + ad_V A / 2:
///   change of V:      X (V of the parent) + B x          turn: R^T (turn of the parent) + (angular part of
///   A) x / 2 change of h:      I (change of V) + X^T (change of h - ad_A^T h x / 2), and so for the first
///   moment m change of r:      A^T (change of h - (h/2)(ad_{change of V}^T h + ad_V^T (change of h) + change
///   of w))
/// where w = (m x g, mass g) and a turn phi changes g by g x phi.
JointRow MidpointStep::row(int i, double d) const noexcept {
  using lie::Vec3;
  const rbd::AxisLink& k = chain_[i];
  const rbd::Half6<double>&V = V_[at(i)], &H = H_[at(i)];
  const Vec3<double>&g = g_[at(i)], &m = moment_[at(i)];
  const double half = 0.5 * h_;
  const rbd::Half6<double> turn = rbd::bracket_with_axis(k, V, 1.0);  // ad_V A
  const rbd::Half6<double> A =
      k.prismatic ? rbd::Half6<double>{{}, {0, 0, 1}} : rbd::Half6<double>{{0, 0, 1}, {}};
  const rbd::Half6<double> coad = coadjoint(A, H);
  JointRow j;
  j.b = {(1 / h_) * A + 0.5 * turn, 0.5 * A.a};
  j.e = {0.5 * coad,
         k.prismatic ? Vec3<double>{0, 0, -0.5 * k.outer_mass} : Vec3<double>{0.5 * m.y, -0.5 * m.x, 0}};
  j.l = {A - half * turn, -half * cross(g, A.a)};
  j.k.h = half * coad;
  if (k.prismatic) {
    j.k.m = -half * k.outer_mass * cross(A.l, g);
  } else {
    j.k.m = -half * (g.z * m - dot(m, g) * A.a);
  }
  j.c = k.armature / h_ + 0.5 * k.damping;
  if (stop_torque(k, options_.stop_stiffness, from_->q[i] + 0.5 * d) != 0)
    j.c += 0.25 * h_ * options_.stop_stiffness;
  j.K[0][0] = lie::full(k.I_o);
  j.K[0][1] = lie::hat3(k.h);
  j.K[1][0] = transpose(j.K[0][1]);
  j.K[1][1] = {{k.mass, 0, 0}, {0, k.mass, 0}, {0, 0, k.mass}};
  return j;
}

void MidpointStep::linearise(const VectorXd& d) noexcept {
  for (int i = 0; i < chain_.n(); ++i) newton_.rows()[at(i)] = row(i, d[i]);
  newton_.factorise(X_);
}

/// Eq. (16): d <- d - h M^-1 r.  Newton: the exact Jacobian, made anew where the last one no longer gains a
/// factor of ten a time.
void MidpointStep::correct(VectorXd& d) noexcept {
  if (options_.root == Root::feedback) {
    rbd::solve(chain_, poses_->data(), factor_->data(), r_.data(), u_.data(), r_.data());
    d -= h_ * r_;
    return;
  }
  if (!linearised_ || relative_ > 0.1 * relative_at_correction_) linearise(d);
  linearised_ = true;
  relative_at_correction_ = relative_;
  newton_.solve(r_.data(), r_.data());
  d -= r_;
}

}  // namespace hamel::dynamics
