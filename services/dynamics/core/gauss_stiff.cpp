#include "services/dynamics/core/gauss_stiff.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {
namespace {

/// Share of a joint's inertia that damping and stops take in one step, from which on they count as strong.
constexpr double kStiffShare = 0.02;

using Complex = std::complex<double>;

lie::Vec3<Complex> widened(const lie::Vec3<double>& v) { return {v.x, v.y, v.z}; }
rbd::LinkPose<Complex> widened(const rbd::LinkPose<double>& X) {
  return {{widened(X.R.x), widened(X.R.y), widened(X.R.z)}, widened(X.p)};
}
rbd::PlanarFrame<Complex> widened(const rbd::PlanarFrame<double>& X) {
  return {X.c, X.s, {X.p.x, X.p.y}, {X.h.x, X.h.y}};
}

}  // namespace

template <class G>
StiffForces<G>::StiffForces(const Chain& chain, const MatrixXd& a)
    : chain_(chain),
      stages_(a.rows()),
      change_(MatrixXd::Zero(a.rows(), chain.n())),
      middle_(VectorXd::Zero(chain.n())),
      X_middle_(at(chain.n())),
      X_(at(chain.n())),
      y_(at(chain.n())),
      u_(at(chain.n())) {
  const Eigen::EigenSolver<MatrixXd> solver(a);
  const Eigen::MatrixXcd vectors = solver.eigenvectors(), inverse = vectors.inverse();
  for (Eigen::Index m = 0; m < stages_; ++m) {
    const Complex lambda = solver.eigenvalues()[m];
    if (lambda.imag() < 0) continue;
    Mode& mode = modes_.emplace_back();
    mode.lambda = lambda, mode.weight = lambda.imag() > 0 ? 2 : 1;
    for (Eigen::Index j = 0; j < stages_; ++j) {
      mode.to.push_back(inverse(m, j));
      mode.from.push_back(vectors(j, m));
    }
    mode.E.resize(at(chain.n()));
    mode.factor.resize(at(chain.n()));
  }
}

template <class G>
bool StiffForces<G>::begin(const Node<G>& from, double h, double stop_stiffness) noexcept {
  h_ = h;
  bool strong = false;
  for (int i = 0; i < chain_.n(); ++i) {
    const double slope = stop_slope(chain_[i], stop_stiffness, from.q[i] + 0.5 * h * from.qd[i]);
    const double c = h * chain_[i].damping, k = h * h * slope;
    strong = strong || (c + k) * from.factor[at(i)].D_inv > kStiffShare;
    for (Mode& mode : modes_) mode.E[at(i)] = mode.lambda * c + mode.lambda * mode.lambda * k;
  }
  if (!strong) return false;
  middle_ = from.q + 0.5 * h * from.qd;
  rbd::place(chain_, middle_.data(), X_middle_.data());
  for (int i = 0; i < chain_.n(); ++i) X_[at(i)] = widened(X_middle_[at(i)]);
  for (Mode& mode : modes_) rbd::factorise<G, Complex>(chain_, X_.data(), mode.E.data(), mode.factor.data());
  return true;
}

template <class G>
void StiffForces<G>::correct(const MatrixXd& F, MatrixXd& F_next, MatrixXd& V_next) noexcept {
  const Eigen::Index n = chain_.n(), rows = F.rows();
  change_ = F_next.topRows(stages_) - F.topRows(stages_);
  for (const Mode& mode : modes_) {
    for (Eigen::Index i = 0; i < n; ++i) {
      y_[at(i)] = 0;
      for (Eigen::Index j = 0; j < stages_; ++j) y_[at(i)] += mode.to[at(j)] * change_(j, i);
    }
    rbd::solve<G, Complex>(chain_, X_.data(), mode.factor.data(), y_.data(), u_.data(), rbd::into(y_.data()));
    for (Eigen::Index i = 0; i < n; ++i) {
      const Complex force = mode.weight * mode.E[at(i)] * y_[at(i)],
                    rate = mode.weight * h_ * mode.lambda * y_[at(i)];
      for (Eigen::Index j = 0; j < rows; ++j) {
        const Complex& part = mode.from[at(std::min(j, stages_ - 1))];
        F_next(j, i) -= (part * force).real();
        V_next(j, i) += (part * rate).real();
      }
    }
  }
}

template class StiffForces<SE3>;
template class StiffForces<SE2>;

}  // namespace hamel::dynamics
