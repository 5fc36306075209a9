#pragma once
/// One sample of each message with a different number in every field.  foreign_fast.cpp and
/// foreign_cyclone.cpp fill the vendors' generated types with the same numbers, field by field and by name.

#include "common/wire/messages.h"

namespace hamel::test {

inline wire::Causes golden_causes() {
  wire::Causes c;
  c.add(wire::ServiceKind::planner, 101);
  c.add(wire::ServiceKind::perception, 102);
  return c;
}

inline void golden(wire::ArmState& m) {
  m.arm = 1, m.incarnation = 2, m.step = 3, m.t_s = 4.5, m.dt_s = 0.001;
  m.position.setConstant(3, 1.25), m.velocity.setConstant(3, 2.25);
  m.momentum.setConstant(3, 3.25), m.torque_applied.setConstant(3, 4.25);
  m.energy_J = 5.5, m.work_J = 6.5;
  m.solver = {wire::SolverStop::stagnated, 7, 8, 9, 10.5};
  m.validity = wire::Validity::holding, m.torque_saturated = true, m.caused_by = golden_causes();
}
inline void golden(wire::TorqueCommand& m) {
  m.arm = 1, m.epoch = 2, m.state_incarnation = 3, m.step = 4, m.t_s = 5.5;
  m.torque.setConstant(2, 6.25), m.includes_gravity = true;
  m.planner_state = wire::PlannerState::moving, m.caused_by = golden_causes();
}
inline void golden(wire::Goal& m) {
  m.arm = 1, m.id = 2, m.kind = wire::GoalKind::pose;
  m.position_m = {3.1, 3.2, 3.3}, m.orientation_xyzw = {0.5, 0.5, -0.5, 0.5};
  m.twist << 4.1, 4.2, 4.3, 4.4, 4.5, 4.6;
  m.joints.setConstant(1, 5.25);
}
inline void golden(wire::ObstacleSet& m) {
  m.source = 1, m.incarnation = 2, m.sequence_number = 3, m.t_s = 4.5, m.next_t_s = wire::kInf;
  m.obstacles.resize(2);
  auto& o = m.obstacles[0];
  o.id = 5, o.shape = {geometry::ShapeKind::capsule, {7.1, 7.2, 7.3}};
  o.X_WO.p = {6.1, 6.2, 6.3};
  o.X_WO.R << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // x to y to z to x: quaternion (0.5, 0.5, 0.5, 0.5)
  o.V_WO << 8.1, 8.2, 8.3, 8.4, 8.5, 8.6;
  o.velocity_known = true, o.sigma_m = 9.5;
  m.obstacles[1].id = 10, m.obstacles[1].shape.kind = geometry::ShapeKind::half_space;
  m.obstacles[1].velocity_known = false;
}
inline void golden(wire::PlannerReport& m) {
  m.arm = 1, m.epoch = 2, m.step = 3, m.t_s = 4.5;
  m.state = wire::PlannerState::stuck, m.reason = wire::Reason::goal_blocked, m.detail = "a wall",
  m.method = "gyro";
  m.goal_id = 5, m.mode_id = 26, m.target_error_m = 6.5, m.orientation_error_rad = 7.5, m.speed_mps = 8.5;
  m.end_effector_m = {9.1, 9.2, 9.3}, m.clearance_m = 10.5, m.clearance_min_m = 11.5, m.contacts = 12;
  m.path_length_m = 13.5, m.time_to_goal_s = 14.5, m.gyroscopic_power_W = 15.5, m.injected_power_W = 16.5;
  m.kinetic_J = 20.5, m.attraction_J = 21.5, m.tank_J = 22.5, m.self_clearance_m = wire::kInf;
  m.pairs_in_range = 23, m.pairs_dropped = 24, m.barrier_rows = 25, m.velocities_estimated = 26;
  m.velocities_unknown = 27, m.escapes = 28;
  m.obstacle_age_s = 17.5, m.cycle_time_s = 18.5, m.commands_late = 19;
  m.links.resize(1);
  auto& l = m.links[0];
  l.link = 1, l.obstacle = 2, l.distance_m = wire::kInf;
  l.point_on_link_m = {4.1, 4.2, 4.3}, l.point_on_obstacle_m = {5.1, 5.2, 5.3};
  l.closing_speed_mps = 6.5, l.phi_rad = 7.5, l.gate = 0.5;
  l.gyroscopic_N = {8.1, 8.2, 8.3}, l.repulsive_N = {9.1, 9.2, 9.3}, l.barrier_multiplier = 10.5;
  m.caused_by = golden_causes();
}
inline void golden(wire::ModeCommand& m) { m.arm = 1, m.id = 2, m.mode = wire::Mode::resume; }
inline void golden(wire::ServiceStatus& m) {
  m.kind = wire::ServiceKind::planner, m.arm = 1, m.incarnation = 3;
  m.version = "0.1.0", m.idl_hash = "abc", m.bus = "fastdds", m.state = wire::ServiceState::degraded,
  m.detail = "slow";
  m.counters = {{"late", 4}, {"lost", 5}};
}
inline void golden(wire::RobotDescription& m) {
  m.arm = 1, m.name = "four_link", m.urdf = "<robot/>";
  m.effort_limits.resize(2);
  m.effort_limits << 2.5, wire::kInf;
}
inline void golden(wire::SimulationClock& m) {
  m.arm = 1, m.incarnation = 2, m.step = 3, m.t_s = 4.5, m.dt_s = 0.001;
  m.pace = wire::Pace::realtime, m.running = true;
}
inline void golden(wire::RunSummary& m) {
  m.arm = 1, m.incarnation = 2, m.steps = 3, m.final_summary = true, m.outcome = "done";
  m.energy_drift_rel = 4.5, m.iterations_mean = 5.5, m.iterations_max = 6, m.residual_max_Nm = 7.5;
  m.substepped = 8, m.commands_missed = 9, m.deadlines_missed = 10, m.trajectory_hash = "0123abcd";
}

}  // namespace hamel::test
