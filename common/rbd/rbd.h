#pragma once
/// Kinematics and dynamics of a chain: free functions over (const Chain&, ..., Workspace&).
///
/// Order of use: positions() or velocities() fill the workspace for a configuration; everything that takes a
/// const Workspace& afterwards reads that configuration.  No function here allocates, locks or throws; sizes
/// are the caller's duty (asserted).  q, qd, tau: n joint values [rad or m], [rad/s or m/s], [N m or N]. A
/// row, block or other strided q, qd or tau must be copied to a vector first: Ref would copy it on the heap.

#include <Eigen/Core>
#include <vector>

#include "common/model/chain.h"
#include "common/rbd/sweeps.h"

namespace hamel::rbd {

using Eigen::MatrixXd;
using Eigen::Ref;
using Eigen::VectorXd;

/// Scratch sized for one chain; one a thread.
struct Workspace {
  explicit Workspace(const model::Chain& chain);
  std::vector<lie::Pose> X_PB;  ///< pose of link i in link i-1 (base for i = 0)
  std::vector<lie::Pose> X_WB;  ///< pose of link i in the world
  std::vector<lie::Twist> V_B;  ///< twist of link i in the world, in frame i; Eq. (5)

  // For inverse_dynamics() and forward_dynamics(), in axis frames; no meaning between calls.
  AxisChain axis;
  Sweep<SE3> sweep;
};

/// Poses of all links.  Eqs. (3), (4).
void positions(const model::Chain& chain, Ref<const VectorXd> q, Workspace& ws) noexcept;
/// Poses and twists of all links.  Eqs. (3)-(5).
void velocities(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                Workspace& ws) noexcept;
/// Pose of the end effector in the world.
lie::Pose tip(const model::Chain& chain, const Workspace& ws) noexcept;
/// J (3 x n): velocity of the point of link `link` now at p_W, world axes.  Columns beyond `link` are zero.
void point_jacobian(const model::Chain& chain, const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                    Ref<MatrixXd> J) noexcept;
/// J (6 x n): twist of the frame at p_W on link `link`, world axes (omega, v of that point).
void frame_jacobian(const model::Chain& chain, const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                    Ref<MatrixXd> J) noexcept;
/// J (6 x n): twist of link `link` in its own frame, V_B = J qd.  Column i is Ad(X_B_i) A_i of Eq. (5).
void body_jacobian(const model::Chain& chain, const Workspace& ws, int link, Ref<MatrixXd> J) noexcept;
/// J (6 x n): twist of link `link` in the world's frame (v: of the point that passes the world's origin).
/// Column i is joint i's screw where it is now, Ad(X_WB_i) A_i.
void space_jacobian(const model::Chain& chain, const Workspace& ws, int link, Ref<MatrixXd> J) noexcept;
/// tau += J^T F: joint torques of a wrench on link `link` at its frame's origin, torque and force in world
/// axes [N m], [N].  Add it to tau of forward_dynamics(), take it off tau of inverse_dynamics().
void add_wrench(const model::Chain& chain, const Workspace& ws, int link, const lie::Wrench& F_W,
                Ref<VectorXd> tau) noexcept;
/// Vdot_B: the derivative of each link's twist in its own frame when qdd = 0, size n.  Eq. (5)
/// differentiated. Needs velocities().
void bias_twists(const model::Chain& chain, const Workspace& ws, Ref<const VectorXd> qd,
                 std::vector<lie::Twist>& Vdot_B) noexcept;
/// Acceleration of the point of `link` now at p_W when qdd = 0 (Jdot qd), world axes.  Needs bias_twists().
Eigen::Vector3d point_bias_acceleration(const Workspace& ws, int link, const Eigen::Vector3d& p_W,
                                        const lie::Twist& Vdot_B) noexcept;
/// The same for one point alone; needs velocities().
Eigen::Vector3d point_bias_acceleration(const model::Chain& chain, const Workspace& ws, int link,
                                        const Eigen::Vector3d& p_W, Ref<const VectorXd> qd) noexcept;
/// M (n x n, both triangles), armature included.
void mass_matrix(const model::Chain& chain, const Workspace& ws, Ref<MatrixXd> M) noexcept;
/// Torque that holds the arm against gravity: tau_g(q) = dU/dq, so that M qdd + c + tau_g = tau.
void gravity_torque(const model::Chain& chain, const Workspace& ws, Ref<VectorXd> tau_g) noexcept;
/// tau = M(q) qdd + c(q, qd) + tau_g(q), recursive, O(n).  Eqs. (5), (8).  No joint damping.
/// tau may be qdd.  What positions() and velocities() left in the workspace stays.
void inverse_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> qdd, Workspace& ws, Ref<VectorXd> tau) noexcept;
/// c(q, qd): torque of Coriolis and centrifugal forces, without gravity, damping and acceleration.  O(n).  c
/// must not be qd.  What positions() and velocities() left in the workspace stays.
void bias_torque(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd, Workspace& ws,
                 Ref<VectorXd> c) noexcept;
/// qdd from tau by the articulated-body sweep, O(n).  Joint damping acts.  qdd may be tau.
/// What positions() and velocities() left in the workspace stays.
void forward_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> tau, Workspace& ws, Ref<VectorXd> qdd) noexcept;
/// Kinetic energy [J], armature included.  Needs velocities().
double kinetic_energy(const model::Chain& chain, const Workspace& ws, Ref<const VectorXd> qd) noexcept;
/// Momentum map: momentum of the whole arm in world axes, angular about the world's origin.  Armature left
/// out.  Needs velocities().  Its component along joint 1's screw is p_1, which stays without gravity and
/// torque.
lie::Wrench momentum_W(const model::Chain& chain, const Workspace& ws) noexcept;
/// Potential energy [J] -sum m g . r, zero at the world's origin.
double potential_energy(const model::Chain& chain, const Workspace& ws) noexcept;
/// The energy scale of agreements: sum m_i |g| r_i, r_i the sum of joint-to-joint offsets up to the centre of
/// mass i [J].
double energy_scale(const model::Chain& chain) noexcept;

}  // namespace hamel::rbd
