#include "services/dynamics/core/gauss.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {
namespace {

int padded(int stages) { return stages <= 2 ? 2 : stages <= 4 ? 4 : 8; }

/// The matrix's rows, the last repeated.
MatrixXd with_rows(const MatrixXd& a, int rows) {
  MatrixXd b(rows, a.cols());
  for (Eigen::Index i = 0; i < rows; ++i) b.row(i) = a.row(std::min<Eigen::Index>(i, a.rows() - 1));
  return b;
}
VectorXd with_zeros(const VectorXd& b, int rows) {
  VectorXd longer = VectorXd::Zero(rows);
  longer.head(b.size()) = b;
  return longer;
}

}  // namespace

template <class G>
GaussStep<G>::GaussStep(const Chain& chain, const Options& options, Lanes lanes)
    : chain_(chain),
      options_(options),
      method_(options.stages),
      stages_(options.stages),
      padded_(padded(options.stages)),
      a_(with_rows(method_.a, padded_)),
      extrapolate_(with_rows(method_.extrapolate, padded_)),
      b_(with_zeros(method_.b, padded_)),
      kernel_(stage_kernel<G>(lanes)),
      stiff_forces_(chain, method_.a),
      contraction_(chain.n()),
      x_{MatrixXd::Zero(padded_, chain.n()), MatrixXd::Zero(padded_, chain.n())},
      next_(x_),
      applied_(x_.V),
      scale_inv_(x_.V),
      inertia_(VectorXd::Zero(chain.n())),
      u_(inertia_),
      p_next_(inertia_),
      scratch_(scratch_bytes<G>(chain.n()) + 64) {
  const auto start = reinterpret_cast<std::uintptr_t>(scratch_.data());
  job_.scratch = scratch_.data() + (64 - start % 64) % 64;
  job_.chain = &chain_;
  job_.stop_stiffness = options_.stop_stiffness;
  job_.stages = stages_, job_.padded = padded_;
  job_.a = a_.data(), job_.extrapolate = extrapolate_.data();
  job_.inertia = inertia_.data();
  job_.applied = applied_.data();
  job_.scale_inv = scale_inv_.data();
}

/// [h, V, F] of the last step, stages of joint 0 first; h = 0: none.
template <class G>
std::size_t GaussStep<G>::history_size() const noexcept {
  return 1 + static_cast<std::size_t>(2 * stages_ * chain_.n());
}

template <class G>
void GaussStep<G>::remember(const Stages& x, Node<G>& to) const noexcept {
  const Eigen::Index s = stages_, n = chain_.n();
  to.history[0] = h_;
  Eigen::Map<MatrixXd>(to.history.data() + 1, s, n) = x.V.topRows(s);
  Eigen::Map<MatrixXd>(to.history.data() + 1 + s * n, s, n) = x.F.topRows(s);
}

/// The last step's collocation polynomials carried on, by the first evaluation; the state at rest in its own
/// velocity where there is none.
template <class G>
void GaussStep<G>::guess(Stages& x) noexcept {
  job_.past = nullptr;
  if (from_->history[0] == h_ && options_.start != Start::previous) {
    job_.past = from_->history.data() + 1;
    return;
  }
  x.V.rowwise() = from_->qd.transpose();
  x.F.setZero();
}

/// sum b_j x_j over the stages of one joint, two by two.
template <class G>
double GaussStep<G>::mean(const double* x) const noexcept {
  using Pair = lie::Pack<2, lie::Baseline>;
  const double* b = b_.data();
  Pair sum{};
  for (int j = 0; j < padded_; j += 2) sum += Pair::load(b + j) * Pair::load(x + j);
  return sum.v[0] + sum.v[1];
}

template <class G>
void GaussStep<G>::begin(const Node<G>& from, const Load<G>& load, double h) noexcept {
  from_ = &from, load_ = &load, h_ = h, mismatch_ = 0;
  for (int i = 0; i < chain_.n(); ++i) inertia_[i] = 1 / from.factor[at(i)].D_inv;
  job_.load = &load, job_.tau = load.tau.data(), job_.h = h;
  job_.q = from.q.data(), job_.p = from.p.data();
  job_.rescale = true;
  stiff_ = stiff_forces_.begin(from, h, options_.stop_stiffness);
}

/// What follows from x is nearer to the root than x by the rate at which the mismatch falls: the residual is
/// what it would be there.
template <class G>
Residual GaussStep<G>::evaluate(Stages& x) noexcept {
  job_.V = x.V.data(), job_.F = x.F.data();
  job_.V_next = next_.V.data(), job_.F_next = next_.F.data();
  kernel_(job_);
  job_.rescale = false, job_.past = nullptr;
  const double rate = mismatch_ > 0 ? std::min(1.0, job_.relative / mismatch_) : 1;
  mismatch_ = job_.relative;
  return {job_.torque_Nm, job_.relative * rate};
}

template <class G>
void GaussStep<G>::correct(Stages& x) noexcept {
  if (stiff_) stiff_forces_.correct(x.F, next_.F, next_.V);
  x.V.swap(next_.V);
  x.F.swap(next_.F);
}

template <class G>
StepReport GaussStep<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  begin(from, load, h);
  guess(x_);
  contraction_ = Contraction(chain_.n());
  contraction_.look_no_further();
  StepReport report = find_root(*this, options_, contraction_, x_);
  if (report.iterations < report.evaluations) correct(x_);  // what follows from x is nearer to the root
  report.evaluations *= stages_;
  if (!report.usable()) return report;
  applied_.array() *= x_.V.array();  // power
  for (int i = 0; i < chain_.n(); ++i) {
    u_[i] = from.q[i] + h * mean(x_.V.col(i).data());
    p_next_[i] = from.p[i] + h * mean(x_.F.col(i).data());
    report.work_J += h * mean(applied_.col(i).data());
  }
  remember(x_, to);
  to.place(chain_, u_);
  to.p = p_next_;
  to.move_with_momentum(chain_);
  return report;
}

/// q(t) = q_end - h integral of V from t to the end, and p with F.
template <class G>
bool GaussStep<G>::interpolate(const Node<G>& end, double back, VectorXd& q, VectorXd& p) const noexcept {
  const double h = end.history[0];
  if (!(h > 0) || !(back >= 0) || !(back <= h)) return false;
  const double theta = 1 - back / h;
  const Eigen::Index s = stages_, n = chain_.n();
  const double* V = end.history.data() + 1;
  const double* F = V + s * n;
  q = end.q, p = end.p;
  for (Eigen::Index j = 0; j < s; ++j) {
    const double w = h * (method_.b[j] - method_.weight(j, theta));
    for (Eigen::Index i = 0; i < n; ++i) q[i] -= w * V[i * s + j], p[i] -= w * F[i * s + j];
  }
  return true;
}

template class GaussStep<SE3>;
template class GaussStep<SE2>;

}  // namespace hamel::dynamics
