#include "services/planner/core/arm.h"

namespace hamel::planner {
namespace {

// Largest distance between first joint and end effector: all offsets stretched out, prismatic joints at full
// length.
double reach(const model::Chain& chain) {
  double sum = chain.X_NE().p.norm();
  for (int i = 0; i < chain.n(); ++i) {
    if (i > 0) sum += chain.joint(i).X_PJ.p.norm();
    sum += travel_m(chain.joint(i));
  }
  return sum;
}

}  // namespace

Arm::Arm(const model::Chain& as_given)
    : chain(weightless(as_given)),
      with_gravity(as_given),
      ws(chain),
      q(Eigen::VectorXd::Zero(n())),
      qd(q),
      Vdot_B(static_cast<std::size_t>(n()), lie::Twist::Zero()),
      M(Eigen::MatrixXd::Identity(n(), n())),
      M_inverse(M),
      M_llt(M),
      momentum(q),
      coriolis(q),
      gravity(q),
      J_E(Eigen::MatrixXd::Zero(6, n())),
      reach_m(reach(chain)),
      shoulder_W(chain.X_WB0() * chain.joint(0).X_PJ.p) {}

void Arm::look(const Eigen::VectorXd& q_now, const Eigen::VectorXd& qd_now) noexcept {
  q = q_now;
  qd = qd_now;
  rbd::velocities(chain, q, qd, ws);
  X_WE = rbd::tip(chain, ws);
  rbd::frame_jacobian(chain, ws, n() - 1, X_WE.p, J_E);
  V_WE.noalias() = J_E * qd;
}

void Arm::update(const Eigen::VectorXd& q_now, const Eigen::VectorXd& qd_now) noexcept {
  qd.setZero();  // serves as the zero acceleration
  rbd::inverse_dynamics(chain, q_now, qd_now, qd, ws, coriolis);
  look(q_now, qd_now);
  rbd::bias_twists(chain, ws, qd, Vdot_B);
  rbd::gravity_torque(with_gravity, ws, gravity);
  rbd::mass_matrix(chain, ws, M);
  momentum.noalias() = M * qd;
  M_llt.compute(M);
  M_inverse.setIdentity();
  M_llt.solveInPlace(M_inverse);
}

Eigen::Vector3d Arm::angular_velocity(int link) const noexcept {
  const auto i = static_cast<std::size_t>(link);
  return ws.X_WB[i].R * ws.V_B[i].head<3>();
}

}  // namespace hamel::planner
