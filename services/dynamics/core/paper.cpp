#include "services/dynamics/core/paper.h"

#include <algorithm>
#include <cmath>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {

template <class G>
PaperStep<G>::PaperStep(const Chain& chain, const Options& options)
    : chain_(chain),
      options_(options),
      history_(chain.n()),
      d_(VectorXd::Zero(chain.n())),
      r_(d_),
      p_(d_),
      u_(d_),
      V_(at(chain.n())),
      momentum_(at(chain.n())),
      push_(chain.n()),
      newton_(chain) {}

template <class G>
StepReport PaperStep<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  from_ = &from, load_ = &load, h_ = h;
  push_.evaluate(chain_, from.X, load);
  history_.guess(from, h, d_);
  if (options_.start == Start::previous) d_.setZero();
  StepReport report = find_root(*this, options_, d_);
  if (!report.usable()) return report;
  for (int i = 0; i < chain_.n(); ++i) report.work_J += force(i, d_[i]) * d_[i];
  IncrementHistory::push(from, h, d_, to);
  u_ = from.q + d_;
  to.place(chain_, u_);
  for (int i = 0; i < chain_.n(); ++i) V_[at(i)] = carried(from.X[at(i)], to.X[at(i)], V_[at(i)]);
  gather(to, options_.alpha, 1, p_);
  for (int i = 0; i < chain_.n(); ++i) p_[i] += chain_[i].armature * d_[i] / h_ + 0.5 * h_ * force(i, d_[i]);
  to.move_with_momentum(chain_, p_);
  return report;
}

template <class G>
double PaperStep<G>::force(int i, double d) const noexcept {
  const auto& k = chain_[i];
  double f = load_->tau[i] + push_[i] - k.damping * d / h_;
  if (options_.stop_stiffness > 0) f += stop_torque(k, options_.stop_stiffness, from_->q[i]);
  return f;
}

/// p = A^T sum (I V + sign share h ad_V^T I V) + sign (h/2) gravity, the sums carried by the poses of `node`.
template <class G>
void PaperStep<G>::gather(const Node<G>& node, double share, double sign, VectorXd& p) noexcept {
  auto g = chain_.gravity_W;
  for (int i = 0; i < chain_.n(); ++i) {
    const auto& k = chain_[i];
    const auto& X = node.X[at(i)];
    g = turn_to_child(X, g);
    momentum_[at(i)] = momentum(k, X, V_[at(i)]);
    momentum_[at(i)] = momentum_[at(i)] + (sign * share * h_) * coadjoint(V_[at(i)], momentum_[at(i)]) +
                       (sign * 0.5 * h_) * gravity_wrench(k, X, g);
  }
  typename G::template Motion<double> F;
  for (int i = chain_.n(); i-- > 0;) {
    F = F + momentum_[at(i)];
    p[i] = along(chain_[i], node.X[at(i)], F);
    F = to_parent(node.X[at(i)], F);
  }
}

template <class G>
Residual PaperStep<G>::evaluate(const VectorXd& d) noexcept {
  typename G::template Motion<double> V;
  for (int i = 0; i < chain_.n(); ++i) {
    V = to_child(from_->X[at(i)], V);
    add_along(chain_[i], from_->X[at(i)], V, d[i] / h_);
    V_[at(i)] = V;
  }
  gather(*from_, 1 - options_.alpha, -1, p_);
  Residual worst;
  MomentumParts parts;
  for (int i = chain_.n(); i-- > 0;) {
    const auto& k = chain_[i];
    parts.add(k, V_[at(i)]);
    const double p = p_[i] + k.armature * d[i] / h_, push = 0.5 * h_ * force(i, d[i]);
    r_[i] = p - from_->p[i] - push;
    const double scale = std::abs(from_->p[i]) + parts.along(k) + k.armature * std::abs(d[i]) / h_ +
                         std::abs(push) + h_ * (k.weight + kQuiet * chain_.energy_scale) + kNothing;
    if (!std::isfinite(r_[i])) return {r_[i], r_[i]};
    worst.torque_Nm = std::max(worst.torque_Nm, std::abs(r_[i]) / h_);
    worst.relative = std::max(worst.relative, std::abs(r_[i]) / scale);
    parts.shift(from_->X[at(i)].p);
  }
  return worst;
}

/// With X at q^k the twists alone depend on d: the change of a link's momentum is
///   (I - (1 - alpha) h (ad_V^T I + d/dV ad_V^T (I V fixed))) (change of V).
template <>
void PaperStep<SE3>::linearise() noexcept {
  const double s = (1 - options_.alpha) * h_;
  for (int i = 0; i < chain_.n(); ++i) {
    const rbd::AxisLink& k = chain_[i];
    const rbd::LinkPose<double>& X = from_->X[at(i)];
    const rbd::Half6<double>& V = V_[at(i)];
    const rbd::Half6<double> IV = momentum(k, X, V), A = joint_axis(k, X);
    JointRow<SE3>& j = newton_.rows()[at(i)];
    j = {};
    for (int c = 0; c < 6; ++c) {
      rbd::Half6<double> unit;
      double* const part[] = {&unit.a.x, &unit.a.y, &unit.a.z, &unit.l.x, &unit.l.y, &unit.l.z};
      *part[c] = 1;
      const rbd::Half6<double> I_unit = momentum(k, X, unit);
      const rbd::Half6<double> column = I_unit - s * (coadjoint(V, I_unit) + coadjoint(unit, IV));
      lie::Mat3<double>&top = j.K[0][c / 3], &bottom = j.K[1][c / 3];
      (c % 3 == 0 ? top.x : c % 3 == 1 ? top.y : top.z) = column.a;
      (c % 3 == 0 ? bottom.x : c % 3 == 1 ? bottom.y : bottom.z) = column.l;
    }
    j.l.h = A;
    j.b.h = (1 / h_) * A;
    j.c = k.armature / h_ + 0.5 * k.damping;
  }
  newton_.factorise(from_->X);
}
template <>
void PaperStep<SE2>::linearise() noexcept {
  const double s = (1 - options_.alpha) * h_;
  for (int i = 0; i < chain_.n(); ++i) {
    const rbd::PlanarLink& k = chain_[i];
    const rbd::PlanarFrame<double>& X = from_->X[at(i)];
    const rbd::Half3<double>& V = V_[at(i)];
    const rbd::Half3<double> IV = momentum(k, X, V), A = joint_axis(k, X);
    JointRow<SE2>& j = newton_.rows()[at(i)];
    j = {};
    for (int c = 0; c < 3; ++c) {
      const rbd::Half3<double> unit{c == 0 ? 1.0 : 0.0, {c == 1 ? 1.0 : 0.0, c == 2 ? 1.0 : 0.0}};
      const rbd::Half3<double> I_unit = momentum(k, X, unit);
      const rbd::Half3<double> column = I_unit - s * (coadjoint(V, I_unit) + coadjoint(unit, IV));
      j.K.col(c) << column.a, column.l.x, column.l.y;
    }
    j.l.head<3>() << A.a, A.l.x, A.l.y;
    j.b.head<3>() = j.l.head<3>() / h_;
    j.c = k.armature / h_ + 0.5 * k.damping;
  }
  newton_.factorise(from_->X);
}

/// Eq. (16): q^{k+1} <- q^{k+1} - h^2 M(q^k)^-1 tau_e, or Newton.
template <class G>
void PaperStep<G>::correct(VectorXd& d) noexcept {
  if (options_.root == Root::newton) {
    linearise();
    newton_.solve(r_.data(), r_.data());
    d -= r_;
    return;
  }
  rbd::solve<G, double>(chain_, from_->X.data(), from_->factor.data(), r_.data(), u_.data(), r_.data());
  d -= h_ * r_;
}

template class PaperStep<SE3>;
template class PaperStep<SE2>;

}  // namespace hamel::dynamics
