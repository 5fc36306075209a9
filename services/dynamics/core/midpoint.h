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

class MidpointStep final : public TierStep {
 public:
  MidpointStep(const rbd::AxisChain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return IncrementHistory::size(chain_.n()); }
  StepReport advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept override;

  /// The step that evaluate() and correct() are about.
  void begin(const Node& from, const VectorXd& tau, double h) noexcept;
  /// Residual p^-(d) - p_k - (h/2) F.
  Residual evaluate(const VectorXd& d) noexcept;
  const VectorXd& residual() const noexcept { return r_; }
  /// d <- d - J^-1 r: Eq. (16) with M^-1 by the factorisation, or Newton.
  void correct(VectorXd& d) noexcept;
  /// Exact Jacobian at the last evaluate(), and x with J x = r.
  void linearise(const VectorXd& d) noexcept;
  void solve_linear(const VectorXd& r, VectorXd& x) noexcept { newton_.solve(r.data(), x.data()); }

 private:
  void choose_factorisation(const VectorXd& d) noexcept;
  void forward(const VectorXd& d) noexcept;
  Residual backward(const VectorXd& d) noexcept;
  JointRow row(int i, double d) const noexcept;
  double force(int i, double d) const noexcept;

  const rbd::AxisChain& chain_;
  const Options options_;
  // the step being solved
  const Node* from_ = nullptr;
  const VectorXd* tau_ = nullptr;
  double h_ = 0;
  const LinkPoses* poses_ = nullptr;  ///< where factor_ was made
  const JointFactors* factor_ = nullptr;
  // scratch
  VectorXd d_, r_, p_next_, extra_, u_;
  LinkPoses X_, X_factor_;
  JointFactors own_factor_;
  std::vector<rbd::Half6<double>> V_, momentum_, H_;
  std::vector<rbd::Vec3<double>> g_, moment_;
  // Newton: the factorisation serves while it converges fast
  ChainNewton newton_;
  double relative_ = 0, relative_at_correction_ = 0;
  bool linearised_ = false;
};

}  // namespace hamel::dynamics
