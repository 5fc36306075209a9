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
/// Solved by fixed-point iteration from the extrapolated polynomials of the last step (left out: Anderson's
/// acceleration, which saved 6 % of the iterations at most; configurations from the newest rates, which saved
/// 40 % on example 5.1 but cost more on fast arms and long chains); all stages of an iteration side by side
/// in SIMD lanes (gauss_lanes.h); O(n) a stage.  Strong damping and stops are taken implicitly
/// (gauss_stiff.h).

#include <Eigen/Core>
#include <vector>

#include "services/dynamics/core/gauss_lanes.h"
#include "services/dynamics/core/gauss_method.h"
#include "services/dynamics/core/gauss_stiff.h"
#include "services/dynamics/core/increment_root.h"

namespace hamel::dynamics {

/// Velocities and forces at the stages: a column for each joint, a row for each stage, the last rows
/// repeated.
struct Stages {
  MatrixXd V, F;
};

template <class G>
class GaussStep final : public TierStep<G> {
 public:
  using Chain = typename G::Chain;
  GaussStep(const Chain& chain, const Options& options, Lanes lanes = widest_lanes());
  std::size_t history_size() const noexcept override;
  bool keeps_energy() const noexcept override { return true; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;
  bool interpolate(const Node<G>& end, double back, VectorXd& q, VectorXd& p) const noexcept override;

  /// The stages that follow from `x`, and how far they are from it.
  Residual evaluate(Stages& x) noexcept;
  void correct(Stages& x) noexcept;

 private:
  void begin(const Node<G>& from, const Load<G>& load, double h) noexcept;
  void guess(Stages& x) noexcept;
  double mean(const double* x) const noexcept;
  void remember(const Stages& x, Node<G>& to) const noexcept;

  const Chain& chain_;
  const Options options_;
  const GaussMethod method_;
  const int stages_, padded_;
  const MatrixXd a_, extrapolate_;  ///< method_'s, the last row repeated
  const VectorXd b_;                ///< method_.b, zeros for repeated rows
  const StageKernel<G> kernel_;
  StiffForces<G> stiff_forces_;
  bool stiff_ = false;  ///< this step needs them
  const Node<G>* from_ = nullptr;
  const Load<G>* load_ = nullptr;
  double h_ = 0, mismatch_ = 0;
  Contraction contraction_;
  StageJob<G> job_;
  Stages x_, next_;
  MatrixXd applied_, scale_inv_;
  VectorXd inertia_, u_, p_next_;  ///< inertia_: A^T I^A A of each joint, what turns rates into momenta
  std::vector<unsigned char> scratch_;
};

}  // namespace hamel::dynamics
