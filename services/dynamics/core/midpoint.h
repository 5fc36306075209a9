#pragma once
/// Tier `midpoint`: the variational integrator of the discrete Lagrangian
///   L_d(q^k, q^{k+1}) = h L(q^k + d/2, d/h),   d = q^{k+1} - q^k
/// of the whole chain: symplectic, momentum-preserving, self-adjoint, order 2.
///
/// With X_i at q^k_i + d_i/2 and V_i = X_i V_{i-1} + A_i d_i/h, composite momenta and weights from the tip
///   h_i = I_i V_i + X_{i+1}^T h_{i+1},   w_i = gravity wrench_i + X_{i+1}^T w_{i+1}
/// give the discrete Legendre transforms
///   p-+_i = A_i^T (h_i -+ (h/2) (ad_{V_i}^T h_i + w_i)).
/// d solves p^-(d) = p_k + (h/2) F, then p_{k+1} = p^+(d) + (h/2) F, where F = tau - damping d/h + stops at
/// the midpoint enters as left and right discrete force.  d is the unknown: q^{k+1} - q^k is never formed.

#include <vector>

#include "services/dynamics/core/increment_root.h"
#include "services/dynamics/core/newton.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

template <class G>
class MidpointStep final : public TierStep<G> {
 public:
  using Chain = typename G::Chain;
  using Motion = typename G::template Motion<double>;
  using Direction = typename G::template Direction<double>;
  using Matrix = typename ChainNewton<G>::Matrix;
  MidpointStep(const Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return IncrementHistory::size(chain_.n()); }
  bool keeps_energy() const noexcept override { return true; }
  double turn_bound() const noexcept override { return kTurnBound; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

  /// The step that evaluate() and correct() are about.
  void begin(const Node<G>& from, const Load<G>& load, double h) noexcept;
  /// Residual p^-(d) - p_k - (h/2) F.
  Residual evaluate(const VectorXd& d) noexcept;
  const VectorXd& residual() const noexcept { return r_; }
  /// d <- d - J^-1 r: Eq. (16) with M^-1 by the factorisation, or Newton.
  void correct(VectorXd& d) noexcept;
  /// Exact Jacobian J at the last evaluate(); its residual r becomes J^-1 r.
  void linearise_and_solve() noexcept;
  /// x with J x = r.
  void solve_linear(const VectorXd& r, VectorXd& x) noexcept { newton_.solve(r.data(), x.data()); }

 private:
  void choose_factorisation(const VectorXd& d) noexcept;
  void place(const double* d) noexcept;
  void forward(const double* d) noexcept;
  Residual backward(const double* d) noexcept;
  JointRow<G> row(int i, const typename G::template Attitude<double>& R, const Motion& H,
                  const Direction& moment, Matrix& P) const noexcept;
  bool newton_pays() const noexcept;
  Past remembered() const noexcept;
  double work(const double* d) const noexcept;
  double diagonal(int i) const noexcept;

  const Chain& chain_;
  const Options options_;
  const double gravity_;  ///< its strength [m/s^2]
  // the step being solved
  const Node<G>* from_ = nullptr;
  const Load<G>* load_ = nullptr;
  double h_ = 0, rate_ = 0;  ///< 1 / h
  Contraction contraction_;
  const Frames<G>* frames_ = nullptr;  ///< where factor_ was made
  const Factors<G>* factor_ = nullptr;
  // scratch
  VectorXd d_, d_placed_;                        ///< d_placed_, in the plane: where X_ is
  VectorXd r_, p_next_, scale_inv_, extra_, u_;  ///< scale_inv_: 1 / what a residual is measured by
  Frames<G> X_, X_factor_;
  Factors<G> own_factor_;
  Motions<G> V_;
  std::vector<Direction> g_;
  Push<G> push_;
  bool rescale_ = true, placed_ = false, brakes_ = false;  ///< brakes_: damping or stops
  // Newton: the factorisation serves while it converges fast
  ChainNewton<G> newton_;
  bool linearised_ = false;  ///< in this step
  Past feedback_;            ///< what feedback left before that
};

}  // namespace hamel::dynamics
