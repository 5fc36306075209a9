#include "services/dynamics/core/paper.h"

#include <algorithm>
#include <cmath>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {

template <class G>
PaperStep<G>::PaperStep(const Chain& chain, const Options& options)
    : chain_(chain),
      options_(options),
      d_(VectorXd::Zero(chain.n())),
      r_(d_),
      p_(d_),
      u_(d_),
      V_(at(chain.n())),
      momentum_(at(chain.n())),
      push_(chain.n()),
      contraction_(chain.n()),
      newton_(chain) {}

template <class G>
StepReport PaperStep<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  from_ = &from, load_ = &load, h_ = h;
  push_.evaluate(chain_, from.X, load);
  IncrementHistory::guess(from, h, d_);
  if (options_.start == Start::previous) d_.setZero();
  contraction_ = Contraction(chain_.n());
  StepReport report = find_root(*this, options_, contraction_, d_);
  if (!report.usable()) return report;
  move(d_);
  for (int i = 0; i < chain_.n(); ++i) report.work_J += force(i, d_[i]) * d_[i];
  IncrementHistory::push(from, h, {}, d_, to);
  u_ = from.q + d_;
  to.place(chain_, u_);
  for (int i = 0; i < chain_.n(); ++i) V_[at(i)] = carried(from.X[at(i)], to.X[at(i)], V_[at(i)]);
  gather(to, options_.alpha, 1, p_);
  for (int i = 0; i < chain_.n(); ++i) p_[i] += chain_[i].armature * d_[i] / h_ + 0.5 * h_ * force(i, d_[i]);
  to.p = p_;
  to.move_with_momentum(chain_);
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

/// Twists (9).
template <class G>
void PaperStep<G>::move(const VectorXd& d) noexcept {
  typename G::template Motion<double> V;
  for (int i = 0; i < chain_.n(); ++i) {
    V = to_child(from_->X[at(i)], V);
    add_along(chain_[i], from_->X[at(i)], V, d[i] / h_);
    V_[at(i)] = V;
  }
}

template <class G>
Residual PaperStep<G>::evaluate(const VectorXd& d) noexcept {
  move(d);
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

namespace {
/// The change of a link's momentum with its twist, column by column of unit twists.
template <int N, class Unit, class Momentum, class Matrix>
void add_columns(const Unit& unit, const Momentum& momentum_of, Matrix& P) {
  for (std::size_t c = 0; c < std::size_t{N}; ++c) {
    std::array<double, std::size_t{N}> one{};
    one[c] = 1;
    const std::array<double, std::size_t{N}> out = momentum_of(unit(one));
    for (std::size_t r = 0; r < std::size_t{N}; ++r) P[r].add(c, out[r]);
  }
}
}  // namespace

/// With X at q^k the twists alone depend on d: the change of a link's momentum is
///   (I - (1 - alpha) h (ad_V^T I + d/dV ad_V^T (I V fixed))) (change of V).
template <>
void PaperStep<SE3>::linearise_and_solve() noexcept {
  const double s = (1 - options_.alpha) * h_;
  const auto row_of = [&](int i, const lie::Mat3<double>& R, JointRow<SE3>::Matrix& P) {
    const rbd::AxisLink& k = chain_[i];
    const rbd::LinkPose<double>& X = from_->X[at(i)];
    const rbd::Half6<double>& V = V_[at(i)];
    const rbd::Half6<double> IV = momentum(k, X, V), A = joint_axis(k, X);
    const auto level = [&](const rbd::Half6<double>& x) -> std::array<double, 6> {
      const lie::Vec3<double> a = R * x.a, l = R * x.l;
      return {a.x, a.y, a.z, l.x, l.y, l.z};
    };
    add_columns<6>(
        [&](const std::array<double, 6>& x) -> rbd::Half6<double> {
          return {transpose_times(R, lie::Vec3<double>{x[0], x[1], x[2]}),
                  transpose_times(R, lie::Vec3<double>{x[3], x[4], x[5]})};
        },
        [&](const rbd::Half6<double>& unit) {
          const rbd::Half6<double> I_unit = momentum(k, X, unit);
          return level(I_unit - s * (coadjoint(V, I_unit) + coadjoint(unit, IV)));
        },
        P);
    const std::array<double, 6> axis = level(A);
    JointRow<SE3> j;
    for (std::size_t c = 0; c < 6; ++c) j.l.add(c, axis[c]), j.b.add(c, axis[c] / h_);
    j.c = k.armature / h_ + 0.5 * k.damping;
    return j;
  };
  newton_.factorise_and_solve(from_->X, row_of, r_.data(), r_.data());
}
template <>
void PaperStep<SE2>::linearise_and_solve() noexcept {
  const double s = (1 - options_.alpha) * h_;
  const auto row_of = [&](int i, rbd::NoAttitude, JointRow<SE2>::Matrix& P) {
    const rbd::PlanarLink& k = chain_[i];
    const rbd::PlanarFrame<double>& X = from_->X[at(i)];
    const rbd::Half3<double>& V = V_[at(i)];
    const rbd::Half3<double> IV = momentum(k, X, V), A = joint_axis(k, X);
    add_columns<3>(
        [](const std::array<double, 3>& x) -> rbd::Half3<double> {
          return {x[0], {x[1], x[2]}};
        },
        [&](const rbd::Half3<double>& unit) -> std::array<double, 3> {
          const rbd::Half3<double> I_unit = momentum(k, X, unit);
          const rbd::Half3<double> z = I_unit - s * (coadjoint(V, I_unit) + coadjoint(unit, IV));
          return {z.a, z.l.x, z.l.y};
        },
        P);
    JointRow<SE2> j;
    j.l = {{Pair{{A.a, A.l.x}}, Pair{{A.l.y, 0}}}};
    j.b = plus(j.b, 1 / h_, {{Pair{{A.a, A.l.x}}, Pair{{A.l.y, 0}}}});
    j.c = k.armature / h_ + 0.5 * k.damping;
    return j;
  };
  newton_.factorise_and_solve(from_->X, row_of, r_.data(), r_.data());
}

/// Eq. (16): q^{k+1} <- q^{k+1} - h^2 M(q^k)^-1 tau_e, or Newton.
template <class G>
void PaperStep<G>::correct(VectorXd& d) noexcept {
  if (options_.root == Root::newton) {
    linearise_and_solve();
    d -= r_;
    return;
  }
  rbd::solve<G, double>(chain_, from_->X.data(), from_->factor.data(), r_.data(), u_.data(),
                        rbd::into(r_.data()));
  d -= h_ * r_;
}

template class PaperStep<SE3>;
template class PaperStep<SE2>;

}  // namespace hamel::dynamics
