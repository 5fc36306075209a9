#include "services/planner/core/mapping.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>

namespace hamel::planner {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d operational_inertia(const scene::PlannerOptions& o, const Matrix3d& B) noexcept {
  // A point no joint can move has B = 0: the floor keeps Lam finite, the Jacobian beside it is zero anyway.
  const double damping = o.lambda2_relative ? std::max(o.lambda2 * B.trace(), 1e-12) : o.lambda2;
  const Matrix3d Lam = (B + damping * Matrix3d::Identity()).llt().solve(Matrix3d::Identity());
  return 0.5 * (Lam + Lam.transpose());
}

Matrix3d movable_inertia(const Matrix3d& Lam, const Matrix3d& B) noexcept {
  const Matrix3d moved = Lam * B * Lam;
  return 0.5 * (moved + moved.transpose());
}

Vector3d joint_rotation(scene::Mapping mapping, const Matrix3d& Lam, const Vector3d& w) noexcept {
  if (mapping == scene::Mapping::force) return w;
  return 0.5 * (Lam.trace() * w - Lam * w);
}

void add_gyroscopic(const Vector3d& w, const Eigen::Ref<const Eigen::MatrixXd>& J,
                    Eigen::MatrixXd& G) noexcept {
  // Entry (i, j) is J_i . (w x J_j) = w . (J_j x J_i).
  for (Eigen::Index j = 0; j < J.cols(); ++j) {
    const Vector3d J_j = J.col(j);
    for (Eigen::Index i = 0; i < j; ++i) {
      const double g = w.dot(J_j.cross(Vector3d(J.col(i))));
      G(i, j) += g;
      G(j, i) -= g;
    }
  }
}

}  // namespace hamel::planner
