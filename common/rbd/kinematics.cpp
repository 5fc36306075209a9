#include <cassert>
#include <cmath>

#include "common/rbd/rbd.h"

namespace hamel::rbd {
namespace {

using lie::Matrix6;
using lie::Pose;
using lie::Twist;
using lie::Wrench;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Vdot_i = X_i Vdot_{i-1} + [V_i, A_i] qd_i: Eq. (5) differentiated with qdd = 0
void bias_twist(const model::Chain& chain, const Workspace& ws, int i, double qd_i, Twist& Vdot) noexcept {
  if (i > 0) Vdot = lie::Ad_inv(ws.X_PB[at(i)], Vdot);
  Vdot += lie::ad(ws.V_B[at(i)], chain.A_B(i)) * qd_i;
}

/// X_PB(q) = X_PJ exp(A q), Eq. (3).
Pose pose_in_parent(const model::Joint& joint, double q) {
  if (joint.kind == model::JointKind::prismatic)
    return {joint.X_PJ.R, joint.X_PJ.p + joint.X_PJ.R * (q * joint.axis)};
  // Rodrigues about a unit axis: 1 + sin W + (1 - cos) W^2, the last factor without cancellation
  const Eigen::Matrix3d W = lie::hat(joint.axis);
  const double s2 = std::sin(0.5 * q);
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity() + std::sin(q) * W + (2 * s2 * s2) * (W * W);
  return {joint.X_PJ.R * R, joint.X_PJ.p};
}

/// Spatial inertia of a link in its own frame.
Matrix6 spatial_inertia(const model::Inertia& b) {
  const Eigen::Matrix3d H = b.mass_kg * lie::hat(b.com_m);
  Matrix6 G;
  G << b.about_com_kgm2 + H * lie::hat(b.com_m).transpose(), H, H.transpose(),
      b.mass_kg * Eigen::Matrix3d::Identity();
  return G;
}

/// X^T G X without forming X's inverse: the inertia of link i in its parent's frame.
Matrix6 to_parent(const Pose& X_PB, const Matrix6& G_B) {
  const Matrix6 X = lie::Ad(inverse(X_PB));
  return X.transpose() * G_B * X;
}

Eigen::Vector3d com_W(const model::Chain& chain, const Workspace& ws, int i) {
  return ws.X_WB[at(i)] * chain.link(i).inertia.com_m;
}

}  // namespace

Workspace::Workspace(const model::Chain& chain)
    : X_PB(at(chain.n())),
      X_WB(at(chain.n())),
      V_B(at(chain.n()), Twist::Zero()),
      axis(chain),
      sweep(chain.n()) {}

void positions(const model::Chain& chain, Ref<const VectorXd> q, Workspace& ws) noexcept {
  assert(q.size() == chain.n());
  for (int i = 0; i < chain.n(); ++i) {
    const Pose& X_WP = i == 0 ? chain.X_WB0() : ws.X_WB[at(i - 1)];
    ws.X_PB[at(i)] = pose_in_parent(chain.joint(i), q[i]);
    ws.X_WB[at(i)] = X_WP * ws.X_PB[at(i)];
  }
}

void velocities(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                Workspace& ws) noexcept {
  assert(qd.size() == chain.n());
  positions(chain, q, ws);
  for (int i = 0; i < chain.n(); ++i) {
    ws.V_B[at(i)] = chain.A_B(i) * qd[i];
    if (i > 0) ws.V_B[at(i)] += lie::Ad_inv(ws.X_PB[at(i)], ws.V_B[at(i - 1)]);
  }
}

Pose tip(const model::Chain& chain, const Workspace& ws) noexcept { return ws.X_WB.back() * chain.X_NE(); }

void point_jacobian(const model::Chain& chain, const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                    Ref<MatrixXd> J) noexcept {
  assert(J.rows() == 3 && J.cols() == chain.n() && link < chain.n());
  J.setZero();
  for (int i = 0; i <= link; ++i) {
    const Pose& X_WB = ws.X_WB[at(i)];
    const Eigen::Vector3d axis_W = X_WB.R * chain.joint(i).axis;
    const bool prismatic = chain.joint(i).kind == model::JointKind::prismatic;
    J.col(i) = prismatic ? axis_W : Eigen::Vector3d(axis_W.cross(p_W - X_WB.p));
  }
}

void frame_jacobian(const model::Chain& chain, const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                    Ref<MatrixXd> J) noexcept {
  assert(J.rows() == 6 && J.cols() == chain.n() && link < chain.n());
  J.setZero();
  for (int i = 0; i <= link; ++i) {
    const Pose& X_WB = ws.X_WB[at(i)];
    const Eigen::Vector3d axis_W = X_WB.R * chain.joint(i).axis;
    if (chain.joint(i).kind == model::JointKind::prismatic) {
      J.col(i).tail<3>() = axis_W;
    } else {
      J.col(i).head<3>() = axis_W;
      J.col(i).tail<3>() = axis_W.cross(p_W - X_WB.p);
    }
  }
}

void space_jacobian(const model::Chain& chain, const Workspace& ws, int link, Ref<MatrixXd> J) noexcept {
  frame_jacobian(chain, ws, link, Eigen::Vector3d::Zero(), J);
}

void body_jacobian(const model::Chain& chain, const Workspace& ws, int link, Ref<MatrixXd> J) noexcept {
  assert(J.rows() == 6 && J.cols() == chain.n() && link < chain.n());
  J.setZero();
  Pose X_iB;  // pose of `link` in link i
  for (int i = link; i >= 0; --i) {
    J.col(i) = lie::Ad_inv(X_iB, chain.A_B(i));
    X_iB = ws.X_PB[at(i)] * X_iB;
  }
}

void add_wrench(const model::Chain& chain, const Workspace& ws, int link, const Wrench& F_W,
                Ref<VectorXd> tau) noexcept {
  assert(tau.size() == chain.n() && link < chain.n());
  Wrench F;  // on link i, in its frame
  const Eigen::Matrix3d& R = ws.X_WB[at(link)].R;
  F << R.transpose() * F_W.head<3>(), R.transpose() * F_W.tail<3>();
  for (int i = link; i >= 0; --i) {
    tau[i] += chain.A_B(i).dot(F);
    F = lie::Ad_inv_T(ws.X_PB[at(i)], F);
  }
}

void bias_twists(const model::Chain& chain, const Workspace& ws, Ref<const VectorXd> qd,
                 std::vector<lie::Twist>& Vdot_B) noexcept {
  assert(qd.size() == chain.n() && Vdot_B.size() == at(chain.n()));
  Twist Vdot = Twist::Zero();
  for (int i = 0; i < chain.n(); ++i) {
    bias_twist(chain, ws, i, qd[i], Vdot);
    Vdot_B[at(i)] = Vdot;
  }
}

Eigen::Vector3d point_bias_acceleration(const model::Chain& chain, const Workspace& ws, int link,
                                        const Eigen::Vector3d& p_W, Ref<const VectorXd> qd) noexcept {
  assert(qd.size() == chain.n() && link < chain.n());
  Twist Vdot = Twist::Zero();
  for (int i = 0; i <= link; ++i) bias_twist(chain, ws, i, qd[i], Vdot);
  return point_bias_acceleration(ws, link, p_W, Vdot);
}

Eigen::Vector3d point_bias_acceleration(const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                                        const lie::Twist& Vdot) noexcept {
  const Pose& X_WB = ws.X_WB[at(link)];
  const Twist& V = ws.V_B[at(link)];
  const Eigen::Vector3d r = inverse(X_WB) * p_W, w = V.head<3>(), wdot = Vdot.head<3>();
  // the body twist's derivative, plus w x v for the turning frame, plus the point's own circling
  const Eigen::Vector3d v_point = V.tail<3>() + w.cross(r);
  return X_WB.R * (Vdot.tail<3>() + wdot.cross(r) + w.cross(v_point));
}

void mass_matrix(const model::Chain& chain, const Workspace& ws, Ref<MatrixXd> M) noexcept {
  assert(M.rows() == chain.n() && M.cols() == chain.n());
  Matrix6 G = Matrix6::Zero();  // composite inertia of link i and all beyond it, in frame i
  for (int i = chain.n(); i-- > 0;) {
    G += spatial_inertia(chain.link(i).inertia);
    Wrench F = G * chain.A_B(i);
    M(i, i) = chain.A_B(i).dot(F) + chain.joint(i).armature;
    for (int j = i; j-- > 0;) {
      F = lie::Ad_inv_T(ws.X_PB[at(j + 1)], F);
      M(i, j) = M(j, i) = chain.A_B(j).dot(F);
    }
    if (i > 0) G = to_parent(ws.X_PB[at(i)], G);
  }
}

void gravity_torque(const model::Chain& chain, const Workspace& ws, Ref<VectorXd> tau_g) noexcept {
  assert(tau_g.size() == chain.n());
  Wrench W = Wrench::Zero();  // weight of link i and all beyond it, in frame i
  for (int i = chain.n(); i-- > 0;) {
    const model::Inertia& body = chain.link(i).inertia;
    const Eigen::Vector3d f = body.mass_kg * (ws.X_WB[at(i)].R.transpose() * chain.gravity_W_mps2());
    W.head<3>() += body.com_m.cross(f);
    W.tail<3>() += f;
    tau_g[i] = -chain.A_B(i).dot(W);
    if (i > 0) W = lie::Ad_inv_T(ws.X_PB[at(i)], W);
  }
}

double kinetic_energy(const model::Chain& chain, const Workspace& ws, Ref<const VectorXd> qd) noexcept {
  assert(qd.size() == chain.n());
  double twice = 0;
  for (int i = 0; i < chain.n(); ++i) {
    const model::Inertia& body = chain.link(i).inertia;
    const Eigen::Vector3d w = ws.V_B[at(i)].head<3>(), v = ws.V_B[at(i)].tail<3>() + w.cross(body.com_m);
    twice += w.dot(body.about_com_kgm2 * w) + body.mass_kg * v.squaredNorm() +
             chain.joint(i).armature * qd[i] * qd[i];
  }
  return 0.5 * twice;
}

Wrench momentum_W(const model::Chain& chain, const Workspace& ws) noexcept {
  Wrench sum = Wrench::Zero();
  for (int i = 0; i < chain.n(); ++i) {
    sum += lie::Ad_inv_T(ws.X_WB[at(i)], Wrench(spatial_inertia(chain.link(i).inertia) * ws.V_B[at(i)]));
  }
  return sum;
}

double potential_energy(const model::Chain& chain, const Workspace& ws) noexcept {
  double U = 0;
  for (int i = 0; i < chain.n(); ++i) {
    U -= chain.link(i).inertia.mass_kg * chain.gravity_W_mps2().dot(com_W(chain, ws, i));
  }
  return U;
}

double energy_scale(const model::Chain& chain) noexcept {
  double sum = 0, reach = 0;
  for (int i = 0; i < chain.n(); ++i) {
    if (i > 0) reach += chain.joint(i).X_PJ.p.norm();
    sum += chain.link(i).inertia.mass_kg * (reach + chain.link(i).inertia.com_m.norm());
  }
  return sum * chain.gravity_W_mps2().norm();
}

}  // namespace hamel::rbd
