#pragma once
/// From a force on a point of the arm to joint torques.

#include <Eigen/Core>

#include "common/scene/options.h"

namespace hamel::planner {

/// Lam = (B + lam2 I)^-1 with B = J M^-1 J^T: damped operational-space inertia.  lam2 absolute or times
/// trace(B).
Eigen::Matrix3d operational_inertia(const scene::PlannerOptions& o, const Eigen::Matrix3d& B) noexcept;

/// Lam B Lam: like Lam where joints move the point, and nothing where none does and Lam grows to 1/lam2. What
/// symmetric weighs by: it mixes both directions, and an obstacle's velocity has a part that no joint makes.
Eigen::Matrix3d movable_inertia(const Eigen::Matrix3d& Lam, const Eigen::Matrix3d& B) noexcept;

/// w' with torque J^T (w' x v):  force: w;  symmetric: (tr(Lam) w - Lam w)/2, so that hat(w') is the
/// symmetrised (Lam hat(w) + hat(w) Lam)/2: weighted by inertia like Eq. (21), and powerless, which (21) is
/// not.
Eigen::Vector3d joint_rotation(scene::Mapping mapping, const Eigen::Matrix3d& Lam,
                               const Eigen::Vector3d& w) noexcept;

/// G += J^T hat(w) J, skew to the bit.
void add_gyroscopic(const Eigen::Vector3d& w, const Eigen::Ref<const Eigen::MatrixXd>& J,
                    Eigen::MatrixXd& G) noexcept;

}  // namespace hamel::planner
