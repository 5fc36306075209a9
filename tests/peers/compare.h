#pragma once
/// Our functions beside a peer's, at one random state.

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "common/rbd/rbd.h"
#include "tests/peers/peer.h"
#include "tests/support/chains.h"

namespace hamel::peers {

inline double condition(const MatrixXd& M) {
  const VectorXd values = Eigen::SelfAdjointEigenSolver<MatrixXd>(M).eigenvalues();
  return values[values.size() - 1] / values[0];
}

/// One state: mass matrix, gravity torque, inverse and forward dynamics, to `tolerance` of the norm; where M
/// is inverted, times its condition.
inline void compare(Peer& peer, const model::Chain& chain, test::Random& rng, double tolerance) {
  const int n = chain.n();
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2), qdd = rng.vector(n, 5), tau = rng.vector(n, 10);
  const VectorXd zero = VectorXd::Zero(n);
  rbd::Workspace ws(chain);
  MatrixXd M(n, n), M_peer;
  rbd::positions(chain, q, ws);
  rbd::mass_matrix(chain, ws, M);
  peer.mass_matrix(q, M_peer);
  EXPECT_LE((M - M_peer).norm(), tolerance * M.norm());

  VectorXd ours(n), theirs(n);
  rbd::gravity_torque(chain, ws, ours);
  peer.inverse_dynamics(q, zero, zero, theirs);
  EXPECT_LE((ours - theirs).norm(), tolerance * (theirs.norm() + rbd::energy_scale(chain)));

  rbd::inverse_dynamics(chain, q, qd, qdd, ws, ours);
  peer.inverse_dynamics(q, qd, qdd, theirs);
  EXPECT_LE((ours - theirs).norm(), tolerance * theirs.norm());

  VectorXd damping(n);
  for (int i = 0; i < n; ++i) damping[i] = chain.joint(i).damping;
  rbd::forward_dynamics(chain, q, qd, tau, ws, ours);
  peer.forward_dynamics(q, qd, tau - damping.cwiseProduct(qd), theirs);
  EXPECT_LE((ours - theirs).norm(), tolerance * condition(M) * theirs.norm());
}

}  // namespace hamel::peers
