#pragma once
/// Tier `hamel`: the paper's integrator, literally.  Order 1, loses energy steadily; kept to compare with.
///
/// Discrete velocity (9), X_i at q^k:     V_i = X_i V_{i-1} + A_i d_i/h
/// Residual (13), backward from the tip:  F_i = X_{i+1}(q^k)^T F_{i+1} + (I_i V_i - I_i V'_i)/h
///     - (1 - alpha) ad_{V_i}^T I_i V_i - alpha ad_{V'_i}^T I_i V'_i - gravity wrench(q^k),   tau_e = A^T F -
///     tau
/// where V' is the previous step's V.  What belongs to the past is gathered, once q^k is known, into
///     p_k = A^T sum (I V' + alpha h ad_{V'}^T I V') + (h/2)(gravity + F)
/// so that h tau_e = p^-(d) - p_k - (h/2) F and a step is a map of (q, p) like every other tier's, start p_0
/// = M v_0.

#include <vector>

#include "services/dynamics/core/increment_root.h"
#include "services/dynamics/core/newton.h"
#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

template <class G>
class PaperStep final : public TierStep<G> {
 public:
  using Chain = typename G::Chain;
  PaperStep(const Chain& chain, const Options& options);
  std::size_t history_size() const noexcept override { return IncrementHistory::size(chain_.n()); }
  double turn_bound() const noexcept override { return kTurnBound; }
  StepReport advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept override;

  Residual evaluate(const VectorXd& d) noexcept;
  void correct(VectorXd& d) noexcept;

 private:
  void move(const VectorXd& d) noexcept;
  void linearise_and_solve() noexcept;
  double force(int i, double d) const noexcept;
  void gather(const Node<G>& node, double share, double sign, VectorXd& p) noexcept;

  const Chain& chain_;
  const Options options_;
  const Node<G>* from_ = nullptr;
  const Load<G>* load_ = nullptr;
  double h_ = 0;
  VectorXd d_, r_, p_, u_;
  Motions<G> V_, momentum_;
  Push<G> push_;
  Contraction contraction_;
  ChainNewton<G> newton_;
};

}  // namespace hamel::dynamics
