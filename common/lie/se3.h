#pragma once
/// Rigid motions.  Twists are (omega, v), wrenches (torque, force): angular first, body frame unless named otherwise.

#include <Eigen/Core>

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
inline Eigen::Vector3d operator*(const Pose& X_AB, const Eigen::Vector3d& p_B) { return X_AB.R * p_B + X_AB.p; }
inline Pose inverse(const Pose& X_AB) { return {X_AB.R.transpose(), -(X_AB.R.transpose() * X_AB.p)}; }

}  // namespace hamel::lie
