#pragma once
/// Rigid motions of the plane.  Twists are (omega, v_x, v_y), wrenches (torque, f_x, f_y), in the body frame
/// unless named otherwise.

#include <Eigen/Core>
#include <cmath>
#include <numbers>

#include "common/lie/series.h"

namespace hamel::lie {

using PlanarTwist = Eigen::Vector3d;
using PlanarWrench = Eigen::Vector3d;

/// Pose of frame B in frame A of the plane; X_AC = X_AB * X_BC.
struct PlanarPose {
  Eigen::Matrix2d R = Eigen::Matrix2d::Identity();
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
};

inline PlanarPose operator*(const PlanarPose& X_AB, const PlanarPose& X_BC) {
  return {X_AB.R * X_BC.R, X_AB.p + X_AB.R * X_BC.p};
}
inline PlanarPose inverse(const PlanarPose& X_AB) {
  return {X_AB.R.transpose(), -(X_AB.R.transpose() * X_AB.p)};
}
/// e_3 x a.
inline Eigen::Vector2d quarter_turn(const Eigen::Vector2d& a) { return {-a.y(), a.x()}; }

/// V_A = Ad(X_AB) V_B.
inline PlanarTwist Ad(const PlanarPose& X_AB, const PlanarTwist& V_B) {
  PlanarTwist V_A;
  V_A[0] = V_B[0];
  V_A.tail<2>() = X_AB.R * V_B.tail<2>() - V_B[0] * quarter_turn(X_AB.p);
  return V_A;
}
inline Eigen::Matrix3d Ad(const PlanarPose& X_AB) {
  Eigen::Matrix3d A;
  A << 1, 0, 0, X_AB.p.y(), X_AB.R(0, 0), X_AB.R(0, 1), -X_AB.p.x(), X_AB.R(1, 0), X_AB.R(1, 1);
  return A;
}
/// F_A = Ad(X_AB^-1)^T F_B.
inline PlanarWrench Ad_inv_T(const PlanarPose& X_AB, const PlanarWrench& F_B) {
  PlanarWrench F_A;
  F_A.tail<2>() = X_AB.R * F_B.tail<2>();
  F_A[0] = F_B[0] + X_AB.p.x() * F_A[2] - X_AB.p.y() * F_A[1];
  return F_A;
}
/// Lie bracket [x, y] = ad_x y.
inline PlanarTwist planar_ad(const PlanarTwist& x, const PlanarTwist& y) {
  PlanarTwist z;
  z[0] = 0;
  z.tail<2>() = x[0] * quarter_turn(y.tail<2>()) - y[0] * quarter_turn(x.tail<2>());
  return z;
}
inline Eigen::Matrix3d planar_ad(const PlanarTwist& x) {
  Eigen::Matrix3d A;
  A << 0, 0, 0, x[2], 0, -x[0], -x[1], x[0], 0;
  return A;
}

/// (1 - cos t) / t, which is odd in t.
inline double versine(double t) { return t * cosc(t * t); }

/// X = exp(hat(x)), x = (angle, rho).
inline PlanarPose exp_se2(const PlanarTwist& x) {
  const double t = x[0], s = sinc(t * t), v = versine(t);
  PlanarPose X;
  X.R << std::cos(t), -std::sin(t), std::sin(t), std::cos(t);
  X.p = s * x.tail<2>() + v * quarter_turn(x.tail<2>());
  return X;
}
/// x with exp_se2(x) = X and |angle| <= pi.
inline PlanarTwist log_se2(const PlanarPose& X) {
  const double t = std::atan2(X.R(1, 0), X.R(0, 0));
  PlanarTwist x;
  x[0] = t;
  // (t/2) cot(t/2) and -t/2: the inverse of [sinc, -versine; versine, sinc]
  x.tail<2>() = (1 - t * t * cotc(t * t)) * X.p - 0.5 * t * quarter_turn(X.p);
  return x;
}

/// d/dt exp(x(t)) = hat(dexp(x) xdot) exp(x), dexp(x) = sum ad_x^k / (k+1)!; body twists use dexp(-x).
inline Eigen::Matrix3d dexp_se2(const PlanarTwist& x) {
  const double t = x[0], s = sinc(t * t), v = versine(t);
  // column of the angle: sum_k J^k / (k+2)! applied to -e_3 x rho, J the quarter turn times t
  const double even = cosc(t * t), odd = t * sinc3(t * t);
  const Eigen::Vector2d c = -quarter_turn(x.tail<2>()), d = even * c + odd * quarter_turn(c);
  Eigen::Matrix3d A;
  A << 1, 0, 0, d.x(), s, -v, d.y(), v, s;
  return A;
}
/// Inverse of dexp_se2.  At its poles, angle 2 pi k, k >= 1, not finite: pole_condition() tells how near.
inline Eigen::Matrix3d dexp_inv_se2(const PlanarTwist& x) {
  const double t = x[0], a = 1 - t * t * cotc(t * t), b = 0.5 * t;
  Eigen::Matrix2d B;
  B << a, b, -b, a;
  const Eigen::Vector2d d = -(B * dexp_se2(x).block<2, 1>(1, 0));
  Eigen::Matrix3d A;
  A << 1, 0, 0, d.x(), B(0, 0), B(0, 1), d.y(), B(1, 0), B(1, 1);
  return A;
}

}  // namespace hamel::lie
