#pragma once
/// The fields of every message in the order of idl/hamel_v1.idl, once, for both directions.  Private to
/// codec.cpp.
///
/// `A` is cdr::Writer or cdr::Reader, `M` the const or mutable message.  tests/integration/golden_test.cpp
/// holds these lines against the serialisers that fastddsgen and idlc make from the IDL.

#include <Eigen/Geometry>
#include <cmath>
#include <concepts>

#include "common/wire/cdr.h"

namespace hamel::wire {

/// IDL's bounds.
inline constexpr std::size_t kMaxLinks = 64, kMaxCounters = 32, kMaxName = 256, kMaxText = 262144;

template <class M, class T>
concept Is = std::same_as<std::remove_const_t<M>, T>;

/// A unit quaternion within 1e-6; made exactly unit on reading.
template <class A, class V>
void unit_quaternion(A& a, const char* field, V& xyzw) {
  a.reals(field, xyzw);
  const double norm_squared = xyzw.squaredNorm();
  a.check(std::abs(norm_squared - 1) <= 2e-6, field, "must be a unit quaternion");
  if constexpr (!std::is_const_v<V>)
    if (std::abs(norm_squared - 1) > 4e-16) xyzw /= std::sqrt(norm_squared);
}

template <class A>
void rotation(A& a, const char* field, const Eigen::Matrix3d& R) {
  a.check((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() <= 1e-6 && R.determinant() > 0, field,
          "must be a rotation");
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const Eigen::Vector4d xyzw = q.normalized().coeffs();
  unit_quaternion(a, field, xyzw);
}
template <class A>
void rotation(A& a, const char* field, Eigen::Matrix3d& R) {
  Eigen::Vector4d xyzw;
  unit_quaternion(a, field, xyzw);
  if (a.ok()) R = Eigen::Quaterniond(xyzw).toRotationMatrix();
}

template <class A, class Cs>
void causes(A& a, Cs& cs) {
  a.list("caused_by", cs.items, cs.size, 12, [](A& ar, auto& c) {
    ar.enumeration("caused_by.service", c.service, ServiceKind::client);
    ar.integer("caused_by.number", c.sequence);
  });
}

template <class A, Is<ArmState> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("incarnation", m.incarnation);
  a.integer("step", m.step);
  a.real("t_s", m.t_s);
  a.real("dt_s", m.dt_s);
  a.joints("position", m.position);
  a.joints("velocity", m.velocity);
  a.joints("momentum", m.momentum);
  a.joints("torque_applied", m.torque_applied);
  a.real("energy_J", m.energy_J);
  a.real("work_J", m.work_J);
  a.enumeration("solver.stop", m.solver.stop, SolverStop::explicit_step);
  a.integer("solver.iterations", m.solver.iterations);
  a.integer("solver.evaluations", m.solver.evaluations);
  a.integer("solver.substeps", m.solver.substeps);
  a.real("solver.residual_Nm", m.solver.residual_Nm, cdr::Real::or_plus_inf);
  a.enumeration("validity", m.validity, Validity::diverged);
  a.boolean("torque_saturated", m.torque_saturated);
  causes(a, m.caused_by);
  const auto n = m.position.size();
  a.check(m.velocity.size() == n, "velocity", "must be as long as position");
  a.check(m.momentum.size() == n, "momentum", "must be as long as position");
  a.check(m.torque_applied.size() == n, "torque_applied", "must be as long as position");
}

template <class A, Is<TorqueCommand> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("epoch", m.epoch);
  a.integer("state_incarnation", m.state_incarnation);
  a.integer("step", m.step);
  a.real("t_s", m.t_s);
  a.joints("torque", m.torque);
  a.boolean("includes_gravity", m.includes_gravity);
  a.enumeration("planner_state", m.planner_state, PlannerState::fault);
  causes(a, m.caused_by);
}

template <class A, Is<Goal> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("id", m.id);
  a.enumeration("kind", m.kind, GoalKind::joints);
  a.reals("position_m", m.position_m);
  if (m.kind == GoalKind::pose)
    unit_quaternion(a, "orientation_xyzw", m.orientation_xyzw);
  else
    a.reals("orientation_xyzw", m.orientation_xyzw);
  a.reals("twist", m.twist);
  a.joints("joints", m.joints);
}

template <class A, Is<geometry::Obstacle> M>
void layout(A& a, M& m) {
  a.integer("obstacles.id", m.id);
  a.enumeration("obstacles.kind", m.shape.kind, geometry::ShapeKind::half_space);
  a.reals("obstacles.position_m", m.X_WO.p);
  rotation(a, "obstacles.orientation_xyzw", m.X_WO.R);
  a.reals("obstacles.dims_m", m.shape.dims_m);
  a.check(m.shape.dims_m.minCoeff() >= 0, "obstacles.dims_m", "must not be negative");
  a.reals("obstacles.twist", m.V_WO);
  a.boolean("obstacles.velocity_known", m.velocity_known);
  a.real("obstacles.sigma_m", m.sigma_m);
  a.check(m.sigma_m >= 0, "obstacles.sigma_m", "must not be negative");
}

template <class A, Is<ObstacleSet> M>
void layout(A& a, M& m) {
  a.integer("source", m.source);
  a.integer("incarnation", m.incarnation);
  a.integer("sequence_number", m.sequence_number);
  a.real("t_s", m.t_s);
  a.real("next_t_s", m.next_t_s, cdr::Real::or_plus_inf);
  a.list("obstacles", m.obstacles, kMaxObstacles, 150, [](A& ar, auto& o) { layout(ar, o); });
}

template <class A, Is<LinkReport> M>
void layout(A& a, M& m) {
  a.integer("links.link", m.link);
  a.integer("links.obstacle_id", m.obstacle);
  a.real("links.distance_m", m.distance_m, cdr::Real::or_plus_inf);
  a.reals("links.point_on_link_m", m.point_on_link_m);
  a.reals("links.point_on_obstacle_m", m.point_on_obstacle_m);
  a.real("links.closing_speed_mps", m.closing_speed_mps);
  a.real("links.phi_rad", m.phi_rad);
  a.real("links.gate", m.gate);
  a.reals("links.gyroscopic_N", m.gyroscopic_N);
  a.reals("links.repulsive_N", m.repulsive_N);
  a.real("links.barrier_multiplier", m.barrier_multiplier);
}

template <class A, Is<PlannerReport> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("epoch", m.epoch);
  a.integer("step", m.step);
  a.real("t_s", m.t_s);
  a.enumeration("state", m.state, PlannerState::fault);
  a.enumeration("reason", m.reason, Reason::internal);
  a.text("detail", m.detail, kMaxName);
  a.text("method", m.method, kMaxName);
  a.integer("goal_id", m.goal_id);
  a.integer("mode_id", m.mode_id);
  a.real("target_error_m", m.target_error_m);
  a.real("orientation_error_rad", m.orientation_error_rad);
  a.real("speed_mps", m.speed_mps);
  a.reals("end_effector_m", m.end_effector_m);
  a.real("clearance_m", m.clearance_m, cdr::Real::or_plus_inf);
  a.real("clearance_min_m", m.clearance_min_m, cdr::Real::or_plus_inf);
  a.integer("contacts", m.contacts);
  a.real("path_length_m", m.path_length_m);
  a.real("time_to_goal_s", m.time_to_goal_s);
  a.real("gyroscopic_power_W", m.gyroscopic_power_W);
  a.real("injected_power_W", m.injected_power_W);
  a.real("kinetic_J", m.kinetic_J);
  a.real("attraction_J", m.attraction_J);
  a.real("tank_J", m.tank_J);
  a.real("self_clearance_m", m.self_clearance_m, cdr::Real::or_plus_inf);
  a.integer("pairs_in_range", m.pairs_in_range);
  a.integer("pairs_dropped", m.pairs_dropped);
  a.integer("barrier_rows", m.barrier_rows);
  a.integer("velocities_estimated", m.velocities_estimated);
  a.integer("velocities_unknown", m.velocities_unknown);
  a.integer("escapes", m.escapes);
  a.real("obstacle_age_s", m.obstacle_age_s, cdr::Real::or_plus_inf);
  a.real("cycle_time_s", m.cycle_time_s);
  a.integer("commands_late", m.commands_late);
  a.list("links", m.links, kMaxLinks, 144, [](A& ar, auto& l) { layout(ar, l); });
  causes(a, m.caused_by);
}

template <class A, Is<ModeCommand> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("id", m.id);
  a.enumeration("mode", m.mode, Mode::clear_fault);
}

/// The key: one instance per service of an arm.
inline std::uint32_t status_key(std::uint32_t arm, ServiceKind kind) {
  return arm * 16 + static_cast<std::uint32_t>(kind);
}

template <class A, Is<ServiceStatus> M>
void layout(A& a, M& m) {
  std::uint32_t instance = status_key(m.arm, m.kind);
  a.integer("instance", instance);
  a.enumeration("kind", m.kind, ServiceKind::client);
  a.integer("arm", m.arm);
  a.check(m.arm < (1U << 28), "arm", "must be less than 2^28");
  a.check(instance == status_key(m.arm, m.kind), "instance", "must be arm * 16 + kind");
  a.integer("incarnation", m.incarnation);
  a.text("version", m.version, kMaxName);
  a.text("idl_hash", m.idl_hash, kMaxName);
  a.text("bus", m.bus, kMaxName);
  a.enumeration("state", m.state, ServiceState::stopping);
  a.text("detail", m.detail, kMaxName);
  a.list("counters", m.counters, kMaxCounters, 13, [](A& ar, auto& c) {
    ar.text("counters.name", c.name, kMaxName);
    ar.integer("counters.value", c.value);
  });
}

template <class A, Is<RobotDescription> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.text("name", m.name, kMaxName);
  a.text("urdf", m.urdf, kMaxText);
  a.joints("effort_limits", m.effort_limits, cdr::Real::or_plus_inf);
}

template <class A, Is<SimulationClock> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("incarnation", m.incarnation);
  a.integer("step", m.step);
  a.real("t_s", m.t_s);
  a.real("dt_s", m.dt_s);
  a.enumeration("pace", m.pace, Pace::realtime);
  a.boolean("running", m.running);
}

template <class A, Is<RunSummary> M>
void layout(A& a, M& m) {
  a.integer("arm", m.arm);
  a.integer("incarnation", m.incarnation);
  a.integer("steps", m.steps);
  a.boolean("final_summary", m.final_summary);
  a.text("outcome", m.outcome, kMaxName);
  a.real("energy_drift_rel", m.energy_drift_rel, cdr::Real::or_plus_inf);
  a.real("iterations_mean", m.iterations_mean);
  a.integer("iterations_max", m.iterations_max);
  a.real("residual_max_Nm", m.residual_max_Nm, cdr::Real::or_plus_inf);
  a.integer("substepped", m.substepped);
  a.integer("commands_missed", m.commands_missed);
  a.integer("deadlines_missed", m.deadlines_missed);
  a.text("trajectory_hash", m.trajectory_hash, kMaxName);
}

}  // namespace hamel::wire
