// The rigid-body library against itself: every law here ties two functions that share little code.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "common/rbd/rbd.h"
#include "tests/support/chains.h"
#include "tests/support/no_alloc.h"

namespace hamel::rbd {
namespace {

using test::ForSeed;

/// A random chain with a random state of motion.
class Rbd : public ForSeed {
 protected:
  const int n = std::array{1, 2, 3, 4, 7, 12}[GetParam() % 6];
  const model::Chain chain = test::random_chain(rng, n);
  Workspace ws{chain};
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2), qdd = rng.vector(n, 5);
  VectorXd tau{n}, out{n};
  MatrixXd M{n, n};

  double kinetic_at(const VectorXd& v) {
    velocities(chain, q, v, ws);
    return kinetic_energy(chain, ws, v);
  }
  double potential_at(const VectorXd& x) {
    positions(chain, x, ws);
    return potential_energy(chain, ws);
  }
  VectorXd momentum_at(const VectorXd& x, const VectorXd& v) {
    positions(chain, x, ws);
    mass_matrix(chain, ws, M);
    return M * v;
  }
};
INSTANTIATE_TEST_SUITE_P(Property, Rbd, testing::Range(0u, 60u));

TEST_P(Rbd, ForwardUndoesInverseDynamics) {
  inverse_dynamics(chain, q, qd, qdd, ws, tau);
  for (int i = 0; i < n; ++i) tau[i] += chain.joint(i).damping * qd[i];
  forward_dynamics(chain, q, qd, tau, ws, out);
  EXPECT_LT((out - qdd).norm(), 1e-9 * (1 + qdd.norm()));
}

TEST_P(Rbd, MassMatrixIsTheInertiaOfInverseDynamics) {
  positions(chain, q, ws);
  mass_matrix(chain, ws, M);
  VectorXd with(n), without(n);
  inverse_dynamics(chain, q, qd, qdd, ws, with);
  inverse_dynamics(chain, q, qd, VectorXd::Zero(n), ws, without);
  EXPECT_LT((with - without - M * qdd).norm(), 1e-12 * (1 + with.norm() + without.norm()));
  EXPECT_EQ((M - M.transpose()).norm(), 0);
  EXPECT_EQ(M.llt().info(), Eigen::Success) << M;
}

TEST_P(Rbd, KineticEnergyIsHalfOfMassTimesSpeedSquared) {
  const double T = kinetic_at(qd);
  mass_matrix(chain, ws, M);
  EXPECT_NEAR(0.5 * qd.dot(M * qd), T, 1e-13 * T);
}

TEST_P(Rbd, MomentumMapAlongTheFirstScrewIsTheFirstMomentum) {
  velocities(chain, q, qd, ws);
  mass_matrix(chain, ws, M);
  const double p1 = (M.row(0) * qd).value() - chain.joint(0).armature * qd[0];
  const lie::Twist screw = lie::Ad(ws.X_WB[0], chain.A_B(0));
  const lie::Wrench h = momentum_W(chain, ws);
  EXPECT_NEAR(screw.dot(h), p1, 1e-11 * (1 + h.norm() * screw.norm()));
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();  // mass times velocity of every centre of mass
  for (int i = 0; i < n; ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    const lie::Twist& V = ws.V_B[s];
    linear += chain.link(i).inertia.mass_kg *
              (ws.X_WB[s].R * (V.tail<3>() + V.head<3>().cross(chain.link(i).inertia.com_m)));
  }
  EXPECT_LT((h.tail<3>() - linear).norm(), 1e-12 * (1 + linear.norm()));
}

TEST_P(Rbd, GravityTorqueIsTheSlopeOfPotentialEnergy) {
  positions(chain, q, ws);
  gravity_torque(chain, ws, tau);
  inverse_dynamics(chain, q, VectorXd::Zero(n), VectorXd::Zero(n), ws, out);
  EXPECT_LT((tau - out).norm(), 1e-12 * (1 + tau.norm()));
  const double e = 1e-5;
  for (int i = 0; i < n; ++i) {
    const VectorXd dq = e * VectorXd::Unit(n, i);
    EXPECT_NEAR((potential_at(q + dq) - potential_at(q - dq)) / (2 * e), tau[i], 1e-7 * (1 + tau.norm()));
  }
}

// Lagrange: d/dt (M qd) - dT/dq + dU/dq = tau, all by differences of energies and momenta.
TEST_P(Rbd, InverseDynamicsIsLagranges) {
  inverse_dynamics(chain, q, qd, qdd, ws, tau);
  const double e = 1e-5;
  const VectorXd later = momentum_at(q + e * qd + 0.5 * e * e * qdd, qd + e * qdd);
  const VectorXd before = momentum_at(q - e * qd + 0.5 * e * e * qdd, qd - e * qdd);
  VectorXd lagrange = (later - before) / (2 * e);
  for (int i = 0; i < n; ++i) {
    const auto L = [&](double s) {
      const VectorXd x = q + s * VectorXd::Unit(n, i);
      velocities(chain, x, qd, ws);
      return kinetic_energy(chain, ws, qd) - potential_energy(chain, ws);
    };
    lagrange[i] -= (L(e) - L(-e)) / (2 * e);
  }
  EXPECT_LT((lagrange - tau).norm(), 1e-6 * (1 + tau.norm()));
}

TEST_P(Rbd, PowerOfTorqueIsTheRateOfEnergy) {
  inverse_dynamics(chain, q, qd, qdd, ws, tau);
  const double e = 1e-5;
  const auto E = [&](double t) {
    const VectorXd v = qd + t * qdd, x = q + t * qd + 0.5 * t * t * qdd;
    velocities(chain, x, v, ws);
    return kinetic_energy(chain, ws, v) + potential_energy(chain, ws);
  };
  EXPECT_NEAR((E(e) - E(-e)) / (2 * e), tau.dot(qd), 1e-6 * (1 + std::abs(tau.dot(qd)) + std::abs(E(0))));
}

TEST_P(Rbd, JacobiansAreSlopesOfPositions) {
  const int link = n - 1 - static_cast<int>(GetParam() % static_cast<unsigned>(n));
  const Eigen::Vector3d r = rng.vec3(0.5);
  positions(chain, q, ws);
  const Eigen::Vector3d p = ws.X_WB[static_cast<std::size_t>(link)] * r;
  MatrixXd J(3, n), J6(6, n);
  point_jacobian(chain, ws, link, p, J);
  frame_jacobian(chain, ws, link, p, J6);
  EXPECT_EQ((J6.bottomRows(3) - J).norm(), 0);
  const double e = 1e-6;
  for (int i = 0; i < n; ++i) {
    positions(chain, q + e * VectorXd::Unit(n, i), ws);
    const lie::Pose plus = ws.X_WB[static_cast<std::size_t>(link)];
    positions(chain, q - e * VectorXd::Unit(n, i), ws);
    const lie::Pose minus = ws.X_WB[static_cast<std::size_t>(link)];
    EXPECT_LT(((plus * r - minus * r) / (2 * e) - J.col(i)).norm(), 1e-8);
    const Eigen::Vector3d turn = lie::log_so3(plus.R * minus.R.transpose()) / (2 * e);
    EXPECT_LT((turn - J6.col(i).head<3>()).norm(), 1e-8);
  }
}

TEST_P(Rbd, BodyAndSpaceJacobiansAreOneTwistInTwoFrames) {
  const int link = static_cast<int>(GetParam() % static_cast<unsigned>(n));
  velocities(chain, q, qd, ws);
  const lie::Pose X_WB = ws.X_WB[static_cast<std::size_t>(link)];
  MatrixXd body(6, n), space(6, n), frame(6, n);
  body_jacobian(chain, ws, link, body);
  space_jacobian(chain, ws, link, space);
  frame_jacobian(chain, ws, link, X_WB.p, frame);
  EXPECT_LT((lie::Ad(X_WB) * body - space).norm(), 1e-12 * (1 + space.norm()));
  EXPECT_LT((body * qd - ws.V_B[static_cast<std::size_t>(link)]).norm(), 1e-12 * (1 + qd.norm()));
  EXPECT_LT((X_WB.R * body.topRows(3) - frame.topRows(3)).norm() +
                (X_WB.R * body.bottomRows(3) - frame.bottomRows(3)).norm(),
            1e-12 * (1 + frame.norm()));
  EXPECT_EQ(body.rightCols(n - 1 - link).norm() + space.rightCols(n - 1 - link).norm(), 0);
  for (int i = 0; i <= link; ++i) {  // a screw of space is the joint's own, wherever link is
    const lie::Twist screw = lie::Ad(ws.X_WB[static_cast<std::size_t>(i)], chain.A_B(i));
    EXPECT_LT((space.col(i) - screw).norm(), 1e-13 * (1 + screw.norm()));
  }
}

// d/dt X = hat(J_s qd) X = X hat(J_b qd).
TEST_P(Rbd, JacobiansAreTheVelocityOfThePose) {
  const double e = 1e-5;
  positions(chain, q + e * qd, ws);
  const lie::Pose later = ws.X_WB.back();
  positions(chain, q - e * qd, ws);
  const lie::Pose before = ws.X_WB.back();
  positions(chain, q, ws);
  MatrixXd J(6, n);
  space_jacobian(chain, ws, n - 1, J);
  const lie::Twist space = lie::log_se3(later * inverse(before)) / (2 * e);
  EXPECT_LT((space - J * qd).norm(), 1e-8 * (1 + space.norm()));
  body_jacobian(chain, ws, n - 1, J);
  const lie::Twist body = lie::log_se3(inverse(before) * later) / (2 * e);
  EXPECT_LT((body - J * qd).norm(), 1e-8 * (1 + body.norm()));
}

TEST_P(Rbd, AWrenchWorksOnTheTwistOfItsLink) {
  const int link = static_cast<int>(GetParam() % static_cast<unsigned>(n));
  lie::Wrench F;
  F << rng.vec3(2), rng.vec3(5);
  velocities(chain, q, qd, ws);
  MatrixXd J(6, n);
  frame_jacobian(chain, ws, link, ws.X_WB[static_cast<std::size_t>(link)].p, J);
  tau.setConstant(0.5);
  add_wrench(chain, ws, link, F, tau);
  EXPECT_LT((tau - VectorXd::Constant(n, 0.5) - J.transpose() * F).norm(), 1e-12 * (1 + tau.norm()));
}

// Power balance: dE/dt is the power of torque, wrench and damping.
TEST_P(Rbd, PowerOfAllThatActsIsTheRateOfEnergy) {
  model::ChainSpec spec = chain.spec();
  for (model::Joint& joint : spec.joints) joint.damping = 0.4;
  const model::Chain damped = test::checked(spec);
  Workspace braked(damped);
  lie::Wrench F;
  F << rng.vec3(2), rng.vec3(5);
  const VectorXd torque = rng.vector(n, 2);
  VectorXd acting = torque;
  positions(damped, q, braked);
  add_wrench(damped, braked, n - 1, F, acting);
  forward_dynamics(damped, q, qd, acting, braked, out);
  const double e = 1e-5;
  const auto E = [&](double t) {
    const VectorXd v = qd + t * out, x = q + t * qd + 0.5 * t * t * out;
    velocities(damped, x, v, braked);
    return kinetic_energy(damped, braked, v) + potential_energy(damped, braked);
  };
  velocities(damped, q, qd, braked);
  const lie::Twist& V = braked.V_B.back();
  const Eigen::Matrix3d R = braked.X_WB.back().R;
  const double pushed = F.head<3>().dot(R * V.head<3>()) + F.tail<3>().dot(R * V.tail<3>());
  const double power = torque.dot(qd) + pushed - 0.4 * qd.squaredNorm();
  EXPECT_NEAR((E(e) - E(-e)) / (2 * e), power, 1e-5 * (1 + std::abs(power) + std::abs(E(0)) + out.norm()));
}

TEST_P(Rbd, BiasIsWhatRatesAloneAskFor) {
  bias_torque(chain, q, qd, ws, out);
  positions(chain, q, ws);
  gravity_torque(chain, ws, tau);
  VectorXd both(n);
  inverse_dynamics(chain, q, qd, VectorXd::Zero(n), ws, both);
  EXPECT_LT((out + tau - both).norm(), 1e-12 * (1 + both.norm() + tau.norm()));
  VectorXd doubled(n);
  bias_torque(chain, q, 2 * qd, ws, doubled);
  EXPECT_LT((doubled - 4 * out).norm(), 1e-12 * (1 + doubled.norm()));
}

TEST_P(Rbd, TwistsAreJacobianTimesRates) {
  velocities(chain, q, qd, ws);
  const lie::Pose X_WB = ws.X_WB.back();
  MatrixXd J(6, n);
  frame_jacobian(chain, ws, n - 1, X_WB.p, J);
  const lie::Twist V = J * qd;
  EXPECT_LT((X_WB.R.transpose() * V.head<3>() - ws.V_B.back().head<3>()).norm(), 1e-12);
  EXPECT_LT((X_WB.R.transpose() * V.tail<3>() - ws.V_B.back().tail<3>()).norm(), 1e-11);
}

TEST_P(Rbd, BiasAccelerationIsTheSlopeOfVelocityAtConstantRates) {
  const int link = n - 1;
  const Eigen::Vector3d r = rng.vec3(0.5);
  const auto point_velocity = [&](double t) -> Eigen::Vector3d {
    positions(chain, q + t * qd, ws);
    MatrixXd J(3, n);
    point_jacobian(chain, ws, link, ws.X_WB.back() * r, J);
    return J * qd;
  };
  const double e = 1e-5;
  const Eigen::Vector3d slope = (point_velocity(e) - point_velocity(-e)) / (2 * e);
  velocities(chain, q, qd, ws);
  const Eigen::Vector3d bias = point_bias_acceleration(chain, ws, link, ws.X_WB.back() * r, qd);
  EXPECT_LT((bias - slope).norm(), 1e-7 * (1 + bias.norm()));
}

TEST_P(Rbd, TipIsTheLastLinkTimesItsOffset) {
  positions(chain, q, ws);
  lie::Pose X_WE = chain.X_WB0();
  for (const lie::Pose& X_PB : ws.X_PB) X_WE = X_WE * X_PB;
  X_WE = X_WE * chain.X_NE();
  EXPECT_LT((tip(chain, ws).p - X_WE.p).norm() + (tip(chain, ws).R - X_WE.R).norm(), 1e-13);
}

TEST_P(Rbd, AllocatesNothing) {
  if (!test::NoAlloc::supported()) GTEST_SKIP();
  MatrixXd J(3, n), J6(6, n);
  test::NoAlloc guard;
  velocities(chain, q, qd, ws);
  mass_matrix(chain, ws, M);
  gravity_torque(chain, ws, tau);
  point_jacobian(chain, ws, n - 1, tip(chain, ws).p, J);
  frame_jacobian(chain, ws, n - 1, tip(chain, ws).p, J6);
  body_jacobian(chain, ws, n - 1, J6);
  space_jacobian(chain, ws, n - 1, J6);
  add_wrench(chain, ws, n - 1, lie::Wrench::Ones(), tau);
  bias_torque(chain, q, qd, ws, out);
  double sum = point_bias_acceleration(chain, ws, n - 1, tip(chain, ws).p, qd).sum();
  inverse_dynamics(chain, q, qd, qdd, ws, tau);
  forward_dynamics(chain, q, qd, tau, ws, out);
  sum += kinetic_energy(chain, ws, qd) + potential_energy(chain, ws) + energy_scale(chain);
  EXPECT_EQ(guard.calls(), 0) << sum;
}

TEST(NoAlloc, CatchesEigen) {
  if (!test::NoAlloc::supported()) GTEST_SKIP();
  test::NoAlloc guard;
  const VectorXd v = VectorXd::Ones(10);
  EXPECT_GE(guard.calls(), 1) << v.sum();
}

TEST(ForwardDynamics, JointDampingSlowsDown) {
  model::ChainSpec spec = test::planar(1, 1, 0.1, 1);
  spec.gravity_W_mps2.setZero();
  spec.joints[0].damping = 0.5;
  const model::Chain chain = test::checked(spec);
  Workspace ws(chain);
  VectorXd qdd(1);
  forward_dynamics(chain, VectorXd::Zero(1), VectorXd::Constant(1, 2), VectorXd::Zero(1), ws, qdd);
  EXPECT_NEAR(qdd[0], -0.5 * 2 / (1 + 0.05 * 0.05), 1e-15);
}

TEST(ForwardDynamics, PendulumFallsTowardsGravity) {
  const model::Chain chain = test::checked(test::planar(1, 2, 0.4, 0.3));
  Workspace ws(chain);
  VectorXd qdd(1);
  forward_dynamics(chain, VectorXd::Zero(1), VectorXd::Zero(1), VectorXd::Zero(1), ws, qdd);
  EXPECT_NEAR(qdd[0], -2 * 9.81 * 0.2 / (0.3 + 2 * 0.2 * 0.2), 1e-14);
}

TEST(EnergyScale, OfExample51) { EXPECT_NEAR(energy_scale(test::paper_5_1()), 4.4145, 1e-12); }

}  // namespace
}  // namespace hamel::rbd
