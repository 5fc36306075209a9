#pragma once
/// Strong damping and stops in the iteration of tier `gauss`, which a fixed point cannot take: C and K below
/// are diagonal, M = M(q) half a step on.
///
/// Where forces F gave F' and V' = M^-1 (p + h a F), forces F + delta give, as far as damping and stops go,
///   F' - (h a C + h^2 a^2 K) M^-1 delta,    V' + h a M^-1 delta
/// so that delta is their root for
///   (1 + (h a C + h^2 a^2 K) M^-1) delta = F' - F.
/// In the eigenvectors of a, eigenvalues lambda, that is one articulated-body solution in complex numbers
/// each:
///   (M + E) y = (F' - F),   E = h lambda C + h^2 lambda^2 K,   delta = F' - F - E y,   M^-1 delta = y.
/// Conjugate eigenvalues give conjugate results: half of them are solved for.  It is a change of iteration
/// alone: the root stays what it was.  [Hairer, Wanner 1996, IV.8]

#include <complex>
#include <vector>

#include "services/dynamics/core/node.h"

namespace hamel::dynamics {

using Eigen::MatrixXd;

template <class G>
class StiffForces {
 public:
  using Chain = typename G::Chain;
  /// `a`: the method's matrix, s x s.
  StiffForces(const Chain& chain, const MatrixXd& a);
  /// For a step of length h; false when no damping or stop is strong enough to need this.
  bool begin(const Node<G>& from, double h, double stop_stiffness) noexcept;
  /// Makes of F_next = F' and V_next = V' the forces and rates of F + delta.  A column for each joint, rows
  /// beyond s repeat the last.
  void correct(const MatrixXd& F, MatrixXd& F_next, MatrixXd& V_next) noexcept;

 private:
  using Complex = std::complex<double>;
  struct Mode {
    Complex lambda;
    double weight = 1;              ///< 2 for one of a conjugate pair
    std::vector<Complex> to, from;  ///< row of the eigenvectors' inverse, eigenvector
    std::vector<Complex> E;         ///< a joint each
    std::vector<rbd::Factor<G, Complex>> factor;
  };
  const Chain& chain_;
  const Eigen::Index stages_;
  double h_ = 0;
  MatrixXd change_;  ///< F' - F
  VectorXd middle_;  ///< where M is taken
  Frames<G> X_middle_;
  std::vector<Mode> modes_;
  std::vector<typename G::template Frame<Complex>> X_;
  std::vector<Complex> y_, u_;
};

}  // namespace hamel::dynamics
