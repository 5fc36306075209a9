#include "services/planner/core/attraction.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace hamel::planner {
namespace {

using Eigen::Vector3d;

constexpr double kLimitFar = 0.35, kLimitNear = 0.1;  // where 1.11 begins and is complete [rad or m]
constexpr double kMuch = 0.3;      // a joint counts in full when asked for so much of the fastest one's part
constexpr double kAtLimit = 0.03;  // "at its limit" for the diagnosis [rad or m]

Vector3d saturated(const Vector3d& v, double most) {
  const double size = v.norm();
  return size > most ? Vector3d(v * (most / size)) : v;
}

// Rotation vector from R_WE to R_WG, world axes, in [0, pi].
Vector3d rotation_error(const Eigen::Matrix3d& R_WG, const Eigen::Matrix3d& R_WE) {
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(R_WG * R_WE.transpose()).normalized());
  return turn.angle() * turn.axis();
}

// Distance to the limit that qdd points into.
double room(const model::JointLimits& limits, double q, double qdd) {
  return qdd < 0 ? q - limits.lower : limits.upper - q;
}

}  // namespace

Attraction::Attraction(const Arm& arm, const scene::PlannerOptions& options)
    : options_(options),
      torque_(Eigen::VectorXd::Zero(arm.n())),
      qdd_(torque_),
      drive_(torque_),
      WJ_(Eigen::MatrixXd::Zero(arm.n(), 6)),
      W_(Eigen::MatrixXd::Identity(arm.n(), arm.n())),
      W_llt_(W_) {}

void Attraction::update(const Arm& arm, const scene::Goal& goal, double age_s, double slow) noexcept {
  if (goal.kind == scene::GoalKind::joints)
    toward_joints(arm, goal, slow);
  else
    toward_pose(arm, goal, age_s, slow);
}

void Attraction::toward_pose(const Arm& arm, const scene::Goal& goal, double age_s, double slow) noexcept {
  const bool pose = goal.kind == scene::GoalKind::pose;
  const double rate = options_.kp / options_.kv;
  X_WT_ = lie::moved(goal.X_WG, goal.V_WG, age_s);
  const Vector3d e = X_WT_.p - arm.X_WE.p;
  const Vector3d v_d = slow * saturated(rate * e, options_.vmax_mps);
  a_.tail<3>() = -options_.kv * (arm.V_WE.tail<3>() - goal.V_WG.tail<3>() - v_d);
  error_ = {e.norm(), 0, e.norm() / options_.goal_tolerance_m};
  if (pose) {
    const Vector3d r = rotation_error(X_WT_.R, arm.X_WE.R);
    const Vector3d w_d = slow * saturated(rate * r, options_.angular_vmax_radps);
    a_.head<3>() = -options_.kv * (arm.V_WE.head<3>() - goal.V_WG.head<3>() - w_d);
    error_.angle_rad = r.norm();
    error_.scaled = std::max(error_.scaled, error_.angle_rad / options_.goal_tolerance_rad);
  }
  const bool weighted = options_.method == scene::Method::gyro && options_.limit_weight > 0;
  map(arm, pose ? 6 : 3);
  if (weighted) map_with_limits(arm, pose ? 6 : 3);
}

void Attraction::toward_joints(const Arm& arm, const scene::Goal& goal, double slow) noexcept {
  X_WT_.p = arm.X_WE.p;
  qdd_ = (options_.kp / options_.kv) * (goal.joints - arm.q);  // v_d, then the acceleration
  const double tip_speed = (arm.J_E.bottomRows<3>().lazyProduct(qdd_)).norm();
  qdd_ *= tip_speed > options_.vmax_mps ? slow * options_.vmax_mps / tip_speed : slow;
  drive_ = options_.kv * qdd_;
  qdd_ = drive_ - options_.kv * arm.qd;
  torque_.noalias() = arm.M * qdd_;
  braking_ = options_.kv * arm.qd.dot(arm.momentum);
  potential_ = 0;
  for (int j = 0; j < arm.n(); ++j) {
    const double e_j = goal.joints[j] - arm.q[j];
    for (int i = 0; i < arm.n(); ++i)
      potential_ += 0.5 * options_.kp * (goal.joints[i] - arm.q[i]) * arm.M(i, j) * e_j;
  }
  error_ = {(goal.joints - arm.q).lpNorm<Eigen::Infinity>(), 0, 0};
  error_.scaled = error_.position_m / options_.goal_tolerance_joint;
}

// Lam^-1 = J W^-1 J^T + damping, from WJ_ = W^-1 J^T; angular and linear rows are damped each in their own
// units.
void Attraction::operational_inertia(Eigen::Index rows, double scale) noexcept {
  for (Eigen::Index first = 6 - rows; first < 6; first += 3) {
    const double trace = Lam_inverse_.diagonal().segment<3>(first).sum();
    const double lam2 =
        scale * (options_.lambda2_relative ? std::max(options_.lambda2 * trace, 1e-12) : options_.lambda2);
    Lam_inverse_.diagonal().segment<3>(first).array() += lam2;
  }
}

// tau = J^T Lam a, Eq. (17).
void Attraction::map(const Arm& arm, Eigen::Index rows) noexcept {
  const auto J = arm.J_E.bottomRows(rows);
  auto WJ = WJ_.rightCols(rows);
  WJ.noalias() = arm.M_inverse.lazyProduct(J.transpose());
  Lam_inverse_.setIdentity();
  Lam_inverse_.bottomRightCorner(rows, rows).noalias() = J.lazyProduct(WJ);
  operational_inertia(rows, 1);
  if (rows == 3) a_.head<3>().setZero();
  Lam_.compute(Lam_inverse_);
  const Eigen::Matrix<double, 6, 1> f = Lam_.solve(a_);
  torque_.noalias() = arm.J_E.transpose().lazyProduct(f);
  const double a2 = a_.squaredNorm(), e = error_.position_m, inertia = a2 > 0 ? f.dot(a_) / a2 : 0;
  potential_ = 0.5 * options_.kp * inertia * (e * e + error_.angle_rad * error_.angle_rad);
  qdd_.noalias() = arm.M_inverse * torque_;
  brake(arm, rows);
}

// The mapping's answer to -kv xdot alone: its power, and what is left without it.
void Attraction::brake(const Arm& arm, Eigen::Index rows) noexcept {
  Eigen::Matrix<double, 6, 1> v = Eigen::Matrix<double, 6, 1>::Zero();
  v.tail(rows) = arm.V_WE.tail(rows);
  const Eigen::Matrix<double, 6, 1> f = Lam_.solve(v);
  drive_.noalias() = options_.kv * WJ_.rightCols(rows).lazyProduct(f.tail(rows));
  braking_ = arm.momentum.dot(drive_);
  drive_ += qdd_;
}

// qdd = W^-1 J^T (J W^-1 J^T + lam2/10)^-1 a, tau = M qdd, where W weighs down a joint near a limit it is
// asked to move into; two passes, each from the qdd before it.  planner.md 1.11.  The weight comes with how
// much of the motion is asked of the joint: a whole one at once, where the sign of qdd turns, made the
// accelerations of the 8-sphere Panda scenes vary by 103 rad/s^2 a second instead of 88.
void Attraction::map_with_limits(const Arm& arm, Eigen::Index rows) noexcept {
  const auto J = arm.J_E.bottomRows(rows);
  auto WJ = WJ_.rightCols(rows);
  for (int pass = 0; pass < 2; ++pass) {
    W_ = arm.M;
    const double much = kMuch * qdd_.lpNorm<Eigen::Infinity>();
    for (int j = 0; j < arm.n(); ++j) {
      const double asked = std::abs(qdd_[j]);
      const double free = room(arm.chain.joint(j).limits, arm.q[j], qdd_[j]);
      const double near = std::clamp((kLimitFar - free) / (kLimitFar - kLimitNear), 0.0, 1.0);
      const double g = asked < much ? near * asked / much : near;
      W_(j, j) += options_.limit_weight * g * g * (arm.M(j, j) + 0.1);
    }
    W_llt_.compute(W_);
    WJ = J.transpose();
    W_llt_.solveInPlace(WJ);
    Lam_inverse_.setIdentity();
    Lam_inverse_.bottomRightCorner(rows, rows).noalias() = J.lazyProduct(WJ);
    operational_inertia(rows, 0.1);
    Lam_.compute(Lam_inverse_);
    const Eigen::Matrix<double, 6, 1> f = Lam_.solve(a_);
    qdd_.noalias() = WJ.lazyProduct(f.tail(rows));
  }
  torque_.noalias() = arm.M * qdd_;
  brake(arm, rows);
}

bool Attraction::beyond_limits(const Arm& arm, const scene::Goal& goal) noexcept {
  for (int j = 0; j < arm.n(); ++j) {
    const model::JointLimits& limits = arm.chain.joint(j).limits;
    if (goal.joints[j] < limits.lower || goal.joints[j] > limits.upper) return true;
  }
  return false;
}

void Attraction::clamp_to_limits(const Arm& arm, scene::Goal& goal) noexcept {
  for (int j = 0; j < arm.n(); ++j) {
    const model::JointLimits& limits = arm.chain.joint(j).limits;
    goal.joints[j] = std::clamp(goal.joints[j], limits.lower, limits.upper);
  }
}

int Attraction::blocked_joint(const Arm& arm) const noexcept {
  for (int j = 0; j < arm.n(); ++j)
    if (std::abs(qdd_[j]) > 1e-3 && room(arm.chain.joint(j).limits, arm.q[j], qdd_[j]) < kAtLimit) return j;
  return -1;
}

}  // namespace hamel::planner
