#pragma once
/// Rigid motions.  Twists are (omega, v), wrenches (torque, force): angular first, body frame unless named
/// otherwise.

#include <Eigen/Core>

#include "common/lie/so3.h"

namespace hamel::lie {

using Twist = Eigen::Matrix<double, 6, 1>;
using Wrench = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Pose of frame B measured in frame A; name every variable of this type X_AB.  X_AC = X_AB * X_BC.
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

inline Pose operator*(const Pose& X_AB, const Pose& X_BC) {
  return {X_AB.R * X_BC.R, X_AB.p + X_AB.R * X_BC.p};
}
inline Eigen::Vector3d operator*(const Pose& X_AB, const Eigen::Vector3d& p_B) {
  return X_AB.R * p_B + X_AB.p;
}
inline Pose inverse(const Pose& X_AB) { return {X_AB.R.transpose(), -(X_AB.R.transpose() * X_AB.p)}; }

/// Where X_WB is after t_s of constant velocity: V_WB = (omega, velocity of B's origin) in world axes.
inline Pose moved(const Pose& X_WB, const Twist& V_WB, double t_s) {
  const Eigen::Vector3d turn = t_s * V_WB.head<3>();
  Pose X = X_WB;
  if (!turn.isZero(0)) X.R = exp_so3(turn) * X_WB.R;
  X.p += t_s * V_WB.tail<3>();
  return X;
}

/// The same twist in the other frame: V_A = Ad(X_AB) V_B.
inline Twist Ad(const Pose& X_AB, const Twist& V_B) {
  Twist V_A;
  V_A.head<3>() = X_AB.R * V_B.head<3>();
  V_A.tail<3>() = X_AB.R * V_B.tail<3>() + X_AB.p.cross(V_A.head<3>());
  return V_A;
}
/// V_B = Ad(X_AB^-1) V_A, without forming the inverse.  X_i of Eq. (5).
inline Twist Ad_inv(const Pose& X_AB, const Twist& V_A) {
  Twist V_B;
  V_B.head<3>() = X_AB.R.transpose() * V_A.head<3>();
  V_B.tail<3>() = X_AB.R.transpose() * (V_A.tail<3>() - X_AB.p.cross(V_A.head<3>()));
  return V_B;
}
/// The same wrench in the other frame: F_A = Ad(X_AB^-1)^T F_B.  X_i^T of Eq. (8).
inline Wrench Ad_inv_T(const Pose& X_AB, const Wrench& F_B) {
  Wrench F_A;
  F_A.tail<3>() = X_AB.R * F_B.tail<3>();
  F_A.head<3>() = X_AB.R * F_B.head<3>() + X_AB.p.cross(F_A.tail<3>());
  return F_A;
}
/// 6 x 6 matrix of Ad(X_AB).
inline Matrix6 Ad(const Pose& X_AB) {
  Matrix6 A;
  A << X_AB.R, Eigen::Matrix3d::Zero(), hat(X_AB.p) * X_AB.R, X_AB.R;
  return A;
}

/// Lie bracket [x, y] = ad_x y.
inline Twist ad(const Twist& x, const Twist& y) {
  Twist z;
  z.head<3>() = x.head<3>().cross(y.head<3>());
  z.tail<3>() = x.head<3>().cross(y.tail<3>()) + x.tail<3>().cross(y.head<3>());
  return z;
}
/// Coadjoint ad_x^T F: (ad_x^T F) . y = F . [x, y].
inline Wrench ad_T(const Twist& x, const Wrench& F) {
  Wrench z;
  z.head<3>() = F.head<3>().cross(x.head<3>()) + F.tail<3>().cross(x.tail<3>());
  z.tail<3>() = F.tail<3>().cross(x.head<3>());
  return z;
}
/// 6 x 6 matrix of ad_x.
inline Matrix6 ad(const Twist& x) {
  Matrix6 A;
  A << hat(x.head<3>()), Eigen::Matrix3d::Zero(), hat(x.tail<3>()), hat(x.head<3>());
  return A;
}

/// X = exp(hat(x)), x = (phi, rho).
inline Pose exp_se3(const Twist& x) { return {exp_so3(x.head<3>()), dexp_so3(x.head<3>()) * x.tail<3>()}; }
/// x with exp_se3(x) = X and rotation angle <= pi.
inline Twist log_se3(const Pose& X) {
  Twist x;
  x.head<3>() = log_so3(X.R);
  x.tail<3>() = dexp_inv_so3(x.head<3>()) * X.p;
  return x;
}

/// Lower left block of dexp_se3: how translation follows rotation [Barfoot 2017, (7.86)].
inline Eigen::Matrix3d dexp_coupling(const Twist& x) {
  const double t2 = x.head<3>().squaredNorm();
  const Eigen::Matrix3d W = hat(x.head<3>()), P = hat(x.tail<3>());
  const Eigen::Matrix3d WP = W * P, PW = P * W, WPW = WP * W;
  return 0.5 * P + sinc3(t2) * (WP + PW + WPW) + cosc4(t2) * (W * WP + PW * W - 3 * WPW) +
         0.5 * cosc6(t2) * (WPW * W + W * WPW);
}
/// d/dt exp(x(t)) = hat(dexp(x) xdot) exp(x), dexp(x) = sum ad_x^k / (k+1)!; body twists use dexp(-x).  Eq.
/// (2).
inline Matrix6 dexp_se3(const Twist& x) {
  const Eigen::Matrix3d J = dexp_so3(x.head<3>());
  Matrix6 A;
  A << J, Eigen::Matrix3d::Zero(), dexp_coupling(x), J;
  return A;
}
/// Inverse of dexp_se3.  At its poles, angle 2 pi k, k >= 1, not finite: pole_condition() tells how near.
inline Matrix6 dexp_inv_se3(const Twist& x) {
  const Eigen::Matrix3d J = dexp_inv_so3(x.head<3>());
  Matrix6 A;
  A << J, Eigen::Matrix3d::Zero(), -J * dexp_coupling(x) * J, J;
  return A;
}

}  // namespace hamel::lie
