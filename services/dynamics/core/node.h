#pragma once
/// The arm at one node of time with everything a step may ask of it.

#include <Eigen/Core>
#include <vector>

#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

using Eigen::VectorXd;
using rbd::SE2;
using rbd::SE3;

/// A joint's or stage's number as the index of a std::vector.
inline std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

template <class G>
using Frames = std::vector<typename G::template Frame<double>>;
template <class G>
using Motions = std::vector<typename G::template Motion<double>>;
template <class G>
using Factors = std::vector<rbd::Factor<G, double>>;

/// True when all numbers are finite.  No branch: what is not finite stays so.
template <class Numbers>
bool all_finite(const Numbers& x) noexcept {
  const Eigen::Map<const Eigen::ArrayXd> a(x.data(), static_cast<Eigen::Index>(x.size()));
  return (a * 0.0).sum() == 0;
}

/// Configuration, momentum and velocity.  place() first, then one of the others.  Assignments keep the sizes
/// of the constructor: nothing allocates.
template <class G>
struct Node {
  using Chain = typename G::Chain;
  explicit Node(const Chain& chain);

  /// Frames at q.
  void place(const Chain& chain, const VectorXd& q_new) noexcept;
  /// Factorises M(q); qd = M^-1 p, of the p that stands here, and the energy.
  void move_with_momentum(const Chain& chain) noexcept;
  /// p = M qd and the energy; M(q) is not factorised.
  void move_with_velocity(const Chain& chain, const VectorXd& qd_new) noexcept;

  VectorXd q, p, qd;
  std::vector<double> history;  ///< the tier's own
  Frames<G> X;
  Factors<G> factor;     ///< of M(q), armature included; of move_with_momentum() alone
  double kinetic_J = 0;  ///< p . qd / 2
  double energy_J = 0;   ///< E = p . qd / 2 + U

 private:
  VectorXd scratch_;
  Motions<G> momentum_;
};

}  // namespace hamel::dynamics
