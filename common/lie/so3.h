#pragma once
/// Rotations: hat, exponential, logarithm and the differential of the exponential.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/lie/series.h"

namespace hamel::lie {

/// hat(a) b = a x b.
inline Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d W;
  W << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return W;
}

/// R = exp(hat(phi)), phi = angle * unit axis [rad].  Rodrigues.  Exact at 0, any angle.
inline Eigen::Matrix3d exp_so3(const Eigen::Vector3d& phi) {
  const double x = phi.squaredNorm();
  const Eigen::Matrix3d W = hat(phi);
  return Eigen::Matrix3d::Identity() + sinc(x) * W + cosc(x) * (W * W);
}

/// Unit quaternion (w, x, y, z) of R with w >= 0: the largest component first, so nothing cancels [Shepperd
/// 1978].
inline Eigen::Vector4d quaternion_wxyz(const Eigen::Matrix3d& R) {
  const double t = R.trace();
  Eigen::Vector4d q;
  if (t >= std::max({R(0, 0), R(1, 1), R(2, 2)})) {
    q << 1 + t, R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1);
  } else {
    int i = 0;
    if (R(1, 1) > R(0, 0)) i = 1;
    if (R(2, 2) > R(i, i)) i = 2;
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    q[0] = R(k, j) - R(j, k);
    q[1 + i] = 1 + R(i, i) - R(j, j) - R(k, k);
    q[1 + j] = R(i, j) + R(j, i);
    q[1 + k] = R(i, k) + R(k, i);
  }
  q.normalize();
  return q[0] < 0 ? Eigen::Vector4d(-q) : q;
}

/// phi with exp_so3(phi) = R and |phi| <= pi.  At |phi| = pi either of the two is returned.
inline Eigen::Vector3d log_so3(const Eigen::Matrix3d& R) {
  const Eigen::Vector4d q = quaternion_wxyz(R);
  const Eigen::Vector3d v = q.tail<3>();
  const double s = v.stableNorm();  // sin(|phi| / 2)
  if (s < 1e-150) return 2 * v;
  return v * (2 * std::atan2(s, q[0]) / s);
}

/// d/dt exp(phi(t)) = hat(dexp(phi) phidot) exp(phi); body rates use dexp(-phi).  Eq. (2).
inline Eigen::Matrix3d dexp_so3(const Eigen::Vector3d& phi) {
  const double x = phi.squaredNorm();
  const Eigen::Matrix3d W = hat(phi);
  return Eigen::Matrix3d::Identity() + cosc(x) * W + sinc3(x) * (W * W);
}

/// Inverse of dexp_so3.  At its poles, |phi| = 2 pi k, k >= 1, not finite: pole_condition() tells how near.
inline Eigen::Matrix3d dexp_inv_so3(const Eigen::Vector3d& phi) {
  const Eigen::Matrix3d W = hat(phi);
  return Eigen::Matrix3d::Identity() - 0.5 * W + cotc(phi.squaredNorm()) * (W * W);
}

}  // namespace hamel::lie
