#pragma once
/// The paper's Algorithm I: the joint torque that a discrete motion asks for.

#include "common/rbd/rbd.h"

namespace hamel::dynamics {

/// tau_i = A_i^T F_i with (9) and (13), g gravity, X at q^k unless primed (at q^{k-1}):
///   V_i = X_i V_{i-1} + A_i (q_i^{k+1} - q_i^k)/dt,   V'_i = X'_i V'_{i-1} + A_i (q_i^k - q_i^{k-1})/dt
///   F_i = X_{i+1}^T F_{i+1} + (I_i V_i - I_i V'_i)/dt - (1 - alpha) ad_{V_i}^T I_i V_i
///         - alpha ad_{V'_i}^T I_i V'_i - gravity wrench_i(q^k)
/// and armature (q^{k+1} - 2 q^k + q^{k-1})/dt^2.  No joint damping, as in rbd::inverse_dynamics(), which
/// this tends to with dt (to first order).  q_prev, q, q_next, tau: n each; tau may be none of the others.
/// alpha in [0, 1]. O(n); allocates nothing.  What positions() and velocities() left in the workspace stays.
void discrete_inverse_dynamics(const model::Chain& chain, rbd::Ref<const Eigen::VectorXd> q_prev,
                               rbd::Ref<const Eigen::VectorXd> q, rbd::Ref<const Eigen::VectorXd> q_next,
                               double dt_s, double alpha, rbd::Workspace& ws,
                               rbd::Ref<Eigen::VectorXd> tau) noexcept;

}  // namespace hamel::dynamics
