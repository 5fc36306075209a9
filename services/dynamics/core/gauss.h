#pragma once
/// Tier `gauss`: Galerkin variational integrator with s Gauss points = Gauss collocation in (q, p).
/// Symplectic, momentum-preserving, self-adjoint, order 2 s; s = 1 is the midpoint tier.  [Hairer, Lubich,
/// Wanner 2006, II.1.3]
///
/// With nodes c_i, weights b_i, matrix a_ij of the Gauss method and step h, stage by stage
///   Q_i = q + h sum_j a_ij V_j,   P_i = p + h sum_j a_ij F_j,
///   V_i = M(Q_i)^-1 P_i,          F_i = dL/dq(Q_i, V_i) + tau - damping V_i + stops(Q_i)
///   q' = q + h sum b_i V_i,       p' = p + h sum b_i F_i
/// where dL/dq_i = A_i^T (ad_{V_i}^T h_i + w_i), composite momentum and weight as in midpoint.h.
/// Solved by fixed-point iteration from the extrapolated polynomials of the last step; O(n) a stage.

#include <Eigen/Core>
#include <vector>

#include "services/dynamics/core/increment_root.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

using Eigen::MatrixXd;

/// Coefficients of the s-point Gauss method on [0, 1].
struct GaussMethod {
  explicit GaussMethod(int stages);
  VectorXd c, b;
  MatrixXd a;            ///< a_ij = integral of the j-th Lagrange polynomial from 0 to c_i
  MatrixXd extrapolate;  ///< E_ij: j-th Lagrange polynomial at 1 + c_i
};

/// Velocities and forces at the stages, a column each.
struct Stages {
  MatrixXd V, F;
};

template <class G>
class GaussStep final : public TierStep<G> {
 public:
  using Chain = typename G::Chain;
  GaussStep(const Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override;
  bool keeps_energy() const noexcept override { return true; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

  /// The stages that follow from `x`, and how far they are from it.
  Residual evaluate(const Stages& x) noexcept;
  void correct(Stages& x) noexcept;

 private:
  void guess(Stages& x) noexcept;
  void remember(const Stages& x, Node<G>& to) const noexcept;
  void evaluate_stage(Eigen::Index j) noexcept;
  double force(int i, Eigen::Index j, double qd) const noexcept;

  const Chain& chain_;
  const Options options_;
  const GaussMethod method_;
  const Node<G>* from_ = nullptr;
  const Load<G>* load_ = nullptr;
  double h_ = 0;
  Stages x_, next_;
  MatrixXd Q_, P_;
  VectorXd inertia_, u_, p_next_;  ///< inertia_: A^T I^A A of each joint, what turns rates into momenta
  Frames<G> X_;
  Factors<G> factor_;
  Motions<G> momentum_, V_;
  std::vector<typename G::template Direction<double>> g_;
  Push<G> push_;
  MatrixXd pushed_;  ///< torques of wrenches at the stages
};

}  // namespace hamel::dynamics
