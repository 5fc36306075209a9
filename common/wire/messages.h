#pragma once
/// The wire's types as plain structs: checked, bounded, free of any vendor.  Fields, units and frames are
/// those of idl/hamel_v1.idl; only what differs is said here.  codec.h turns them into payloads and back.
///
/// A decoded message holds: every number finite except where the IDL says +inf, quaternions unit to 1e-6 and
/// then normalised, enums known, equal lengths where the IDL says joints, sizes within the IDL's bounds.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/geometry/shape.h"

namespace hamel::wire {

inline constexpr int kMaxJoints = 64;
inline constexpr std::size_t kMaxObstacles = 4096;
inline constexpr double kInf = std::numeric_limits<double>::infinity();

/// One number per joint, never on the heap.
using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;

enum class ServiceKind : std::uint32_t { unknown, dynamics, planner, perception, client };
enum class SolverStop : std::uint32_t { converged, stagnated, budget_spent, diverged, explicit_step };
enum class Validity : std::uint32_t { valid, command_stale, holding, stopped, diverged };
enum class PlannerState : std::uint32_t { idle, moving, reached, stuck, unsafe, fault };
enum class Reason : std::uint32_t {
  none,
  local_minimum,
  joint_limit,
  goal_blocked,
  unreachable,
  orbit,
  contact,
  stale_obstacles,
  stale_state,
  infeasible,
  non_finite,
  torque_limit,
  driver,
  configuration,
  internal
};
enum class GoalKind : std::uint32_t { position, pose, joints };
enum class Mode : std::uint32_t { stop, hold, resume, clear_fault };
enum class ServiceState : std::uint32_t { starting, ready, degraded, stopping };
enum class Pace : std::uint32_t { lockstep, realtime };

/// "MOVING", "local_minimum", ...: the names users see (agreements: states in capitals, reasons in lower
/// case).
const char* to_string(PlannerState v);
const char* to_string(Reason v);
const char* to_string(Validity v);
const char* to_string(Mode v);
const char* to_string(ServiceKind v);
const char* to_string(ServiceState v);

struct Cause {
  ServiceKind service = ServiceKind::unknown;
  std::uint64_t sequence = 0;
  bool operator==(const Cause&) const = default;
};

/// At most eight causes, never on the heap.
struct Causes {
  std::array<Cause, 8> items;
  std::size_t size = 0;
  void add(ServiceKind service, std::uint64_t sequence) {
    if (size < items.size()) items[size++] = {service, sequence};
  }
};

struct SolverReport {
  SolverStop stop = SolverStop::converged;
  std::uint32_t iterations = 0, evaluations = 0, substeps = 1;
  double residual_Nm = 0;
};

struct ArmState {
  std::uint32_t arm = 0;
  std::uint64_t incarnation = 0, step = 0;
  double t_s = 0, dt_s = 0;
  JointVector position, velocity, momentum, torque_applied;
  double energy_J = 0, work_J = 0;
  SolverReport solver;
  Validity validity = Validity::valid;
  bool torque_saturated = false;
  Causes caused_by;
};

struct TorqueCommand {
  std::uint32_t arm = 0;
  std::uint64_t epoch = 0, state_incarnation = 0, step = 0;
  double t_s = 0;
  JointVector torque;
  bool includes_gravity = false;
  PlannerState planner_state = PlannerState::idle;
  Causes caused_by;
};

struct Goal {
  std::uint32_t arm = 0;
  std::uint64_t id = 0;
  GoalKind kind = GoalKind::position;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector4d orientation_xyzw = {0, 0, 0, 1};
  Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
  JointVector joints;
};

struct ObstacleSet {
  std::uint32_t source = 0;
  std::uint64_t incarnation = 0, sequence_number = 0;
  double t_s = 0, next_t_s = kInf;
  std::vector<geometry::Obstacle> obstacles;
};

struct LinkReport {
  std::uint32_t link = 0, obstacle = 0;
  double distance_m = kInf;
  Eigen::Vector3d point_on_link_m = Eigen::Vector3d::Zero(), point_on_obstacle_m = Eigen::Vector3d::Zero();
  double closing_speed_mps = 0, phi_rad = 0, gate = 0;
  Eigen::Vector3d gyroscopic_N = Eigen::Vector3d::Zero(), repulsive_N = Eigen::Vector3d::Zero();
  double barrier_multiplier = 0;
};

struct PlannerReport {
  std::uint32_t arm = 0;
  std::uint64_t epoch = 0, step = 0;
  double t_s = 0;
  PlannerState state = PlannerState::idle;
  Reason reason = Reason::none;
  std::string detail, method;
  std::uint64_t goal_id = 0, mode_id = 0;
  double target_error_m = 0, orientation_error_rad = 0, speed_mps = 0;
  Eigen::Vector3d end_effector_m = Eigen::Vector3d::Zero();
  double clearance_m = kInf, clearance_min_m = kInf;
  std::uint32_t contacts = 0;
  double path_length_m = 0, time_to_goal_s = -1;
  double gyroscopic_power_W = 0, injected_power_W = 0;
  double kinetic_J = 0, attraction_J = 0, tank_J = 0;
  double self_clearance_m = kInf;
  std::uint32_t pairs_in_range = 0, pairs_dropped = 0, barrier_rows = 0;
  std::uint32_t velocities_estimated = 0, velocities_unknown = 0, escapes = 0;
  double obstacle_age_s = 0, cycle_time_s = 0;
  std::uint64_t commands_late = 0;
  std::vector<LinkReport> links;
  Causes caused_by;
};

struct ModeCommand {
  std::uint32_t arm = 0;
  std::uint64_t id = 0;
  Mode mode = Mode::hold;
};

struct Counter {
  std::string name;
  std::uint64_t value = 0;
};

struct ServiceStatus {
  ServiceKind kind = ServiceKind::unknown;  ///< the key is arm * 16 + kind
  std::uint32_t arm = 0;
  std::uint64_t incarnation = 0;
  std::string version, idl_hash, bus;
  ServiceState state = ServiceState::starting;
  std::string detail;
  std::vector<Counter> counters;
};

struct RobotDescription {
  std::uint32_t arm = 0;
  std::string name, urdf;
  JointVector effort_limits;
};

struct SimulationClock {
  std::uint32_t arm = 0;
  std::uint64_t incarnation = 0, step = 0;
  double t_s = 0, dt_s = 0;
  Pace pace = Pace::lockstep;
  bool running = true;
};

struct RunSummary {
  std::uint32_t arm = 0;
  std::uint64_t incarnation = 0, steps = 0;
  bool final_summary = false;
  std::string outcome;
  double energy_drift_rel = 0, iterations_mean = 0;
  std::uint32_t iterations_max = 0;
  double residual_max_Nm = 0;
  std::uint64_t substepped = 0, commands_missed = 0, deadlines_missed = 0;
  std::string trajectory_hash;
};

}  // namespace hamel::wire
