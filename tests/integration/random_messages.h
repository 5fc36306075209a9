#pragma once
/// Random valid messages of every type, from a literal seed.

#include <Eigen/Geometry>
#include <cstdint>
#include <random>
#include <string>

#include "common/wire/messages.h"

namespace hamel::test {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::size_t below(std::size_t n) { return engine_() % n; }
  bool coin() { return below(2) == 1; }
  std::uint32_t u32() { return static_cast<std::uint32_t>(engine_()); }
  std::uint64_t u64() { return engine_(); }
  template <class E>
  E any(E last) {
    return static_cast<E>(below(static_cast<std::size_t>(last) + 1));
  }
  /// Any magnitude, zeros of both signs and denormals now and then.
  double real() {
    constexpr double kSpecial[] = {0.0, -0.0, 5e-324, 1.7976931348623157e308, -1e-300};
    if (below(8) == 0) return kSpecial[below(5)];
    return std::normal_distribution<>()(engine_) * std::pow(10.0, static_cast<double>(below(20)) - 10);
  }
  double positive() { return std::abs(real()); }
  double real_or_inf() { return below(4) == 0 ? wire::kInf : real(); }
  std::string text(std::size_t longest) {
    std::string s(below(longest + 1), ' ');
    for (char& c : s) c = static_cast<char>(1 + below(255));
    return s;
  }
  template <class V>
  void fill(V& v) {
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = real();
  }
  wire::JointVector joints(std::size_t n) {
    wire::JointVector v(static_cast<Eigen::Index>(n));
    fill(v);
    return v;
  }
  Eigen::Quaterniond rotation() {
    std::normal_distribution<> gauss;
    return Eigen::Quaterniond(gauss(engine_), gauss(engine_), gauss(engine_), gauss(engine_)).normalized();
  }
  wire::Causes causes() {
    wire::Causes c;
    for (std::size_t n = below(9); n > 0; --n) c.add(any(wire::ServiceKind::client), u64());
    return c;
  }

 private:
  std::mt19937_64 engine_;
};

inline void randomise(Random& r, wire::ArmState& m) {
  const std::size_t n = r.below(65);
  m.arm = r.u32(), m.incarnation = r.u64(), m.step = r.u64(), m.t_s = r.real(), m.dt_s = r.real();
  m.position = r.joints(n), m.velocity = r.joints(n), m.momentum = r.joints(n),
  m.torque_applied = r.joints(n);
  m.energy_J = r.real(), m.work_J = r.real();
  m.solver = {r.any(wire::SolverStop::explicit_step), r.u32(), r.u32(), r.u32(), r.real_or_inf()};
  m.validity = r.any(wire::Validity::diverged), m.torque_saturated = r.coin(), m.caused_by = r.causes();
}

inline void randomise(Random& r, wire::TorqueCommand& m) {
  m.arm = r.u32(), m.epoch = r.u64(), m.state_incarnation = r.u64(), m.step = r.u64(), m.t_s = r.real();
  m.torque = r.joints(r.below(65)), m.includes_gravity = r.coin();
  m.planner_state = r.any(wire::PlannerState::fault), m.caused_by = r.causes();
}

inline void randomise(Random& r, wire::Goal& m) {
  m.arm = r.u32(), m.id = r.u64(), m.kind = r.any(wire::GoalKind::joints);
  r.fill(m.position_m), r.fill(m.twist);
  m.orientation_xyzw = r.rotation().coeffs();
  m.joints = r.joints(r.below(65));
}

inline void randomise(Random& r, wire::ObstacleSet& m) {
  m.source = r.u32(), m.incarnation = r.u64(), m.sequence_number = r.u64();
  m.t_s = r.real(), m.next_t_s = r.real_or_inf();
  m.obstacles.resize(r.below(8) == 0 ? r.below(4097) : r.below(20));
  for (geometry::Obstacle& o : m.obstacles) {
    o.id = r.u32(), o.shape.kind = r.any(geometry::ShapeKind::half_space);
    o.shape.dims_m = {r.positive(), r.positive(), r.positive()};
    o.X_WO.R = r.rotation().toRotationMatrix();
    r.fill(o.X_WO.p), r.fill(o.V_WO);
    o.velocity_known = r.coin(), o.sigma_m = r.positive();
  }
}

inline void randomise(Random& r, wire::PlannerReport& m) {
  m.arm = r.u32(), m.epoch = r.u64(), m.step = r.u64(), m.t_s = r.real();
  m.state = r.any(wire::PlannerState::fault), m.reason = r.any(wire::Reason::internal);
  m.detail = r.text(256), m.method = r.text(256), m.goal_id = r.u64(), m.mode_id = r.u64();
  m.target_error_m = r.real(), m.orientation_error_rad = r.real(), m.speed_mps = r.real();
  r.fill(m.end_effector_m);
  m.clearance_m = r.real_or_inf(), m.clearance_min_m = r.real_or_inf(), m.contacts = r.u32();
  m.path_length_m = r.real(), m.time_to_goal_s = r.real();
  m.gyroscopic_power_W = r.real(), m.injected_power_W = r.real();
  m.kinetic_J = r.real(), m.attraction_J = r.real(), m.tank_J = r.real();
  m.self_clearance_m = r.real_or_inf(), m.pairs_in_range = r.u32(), m.pairs_dropped = r.u32();
  m.barrier_rows = r.u32(), m.velocities_estimated = r.u32(), m.velocities_unknown = r.u32();
  m.escapes = r.u32();
  m.obstacle_age_s = r.real_or_inf(), m.cycle_time_s = r.real(), m.commands_late = r.u64();
  m.links.resize(r.below(65));
  for (wire::LinkReport& l : m.links) {
    l.link = r.u32(), l.obstacle = r.u32(), l.distance_m = r.real_or_inf();
    r.fill(l.point_on_link_m), r.fill(l.point_on_obstacle_m), r.fill(l.gyroscopic_N), r.fill(l.repulsive_N);
    l.closing_speed_mps = r.real(), l.phi_rad = r.real(), l.gate = r.real(), l.barrier_multiplier = r.real();
  }
  m.caused_by = r.causes();
}

inline void randomise(Random& r, wire::ModeCommand& m) {
  m.arm = r.u32(), m.id = r.u64(), m.mode = r.any(wire::Mode::clear_fault);
}

inline void randomise(Random& r, wire::ServiceStatus& m) {
  m.kind = r.any(wire::ServiceKind::client), m.arm = r.u32() >> 4, m.incarnation = r.u64();
  m.version = r.text(256), m.idl_hash = r.text(256), m.bus = r.text(256), m.detail = r.text(256);
  m.state = r.any(wire::ServiceState::stopping);
  m.counters.resize(r.below(33));
  for (wire::Counter& c : m.counters) c = {r.text(256), r.u64()};
}

inline void randomise(Random& r, wire::RobotDescription& m) {
  m.arm = r.u32(), m.name = r.text(256), m.urdf = r.text(r.below(8) == 0 ? 262144 : 300);
  m.effort_limits = r.joints(r.below(65));
  if (m.effort_limits.size() > 0 && r.coin()) m.effort_limits[0] = wire::kInf;
}

inline void randomise(Random& r, wire::SimulationClock& m) {
  m.arm = r.u32(), m.incarnation = r.u64(), m.step = r.u64(), m.t_s = r.real(), m.dt_s = r.real();
  m.pace = r.any(wire::Pace::realtime), m.running = r.coin();
}

inline void randomise(Random& r, wire::RunSummary& m) {
  m.arm = r.u32(), m.incarnation = r.u64(), m.steps = r.u64(), m.final_summary = r.coin();
  m.outcome = r.text(256), m.energy_drift_rel = r.real_or_inf(), m.iterations_mean = r.real();
  m.iterations_max = r.u32(), m.residual_max_Nm = r.real_or_inf();
  m.substepped = r.u64(), m.commands_missed = r.u64(), m.deadlines_missed = r.u64();
  m.trajectory_hash = r.text(256);
}

}  // namespace hamel::test
