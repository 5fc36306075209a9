#include "services/planner/convert.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace hamel::planner {
namespace {

/// The wire refuses a message with NaN or infinities where they mean nothing: a report must come through most
/// of all when the arithmetic has left the numbers.
double sayable(double x) {
  constexpr double most = std::numeric_limits<double>::max();
  return std::isnan(x) ? 0 : std::clamp(x, -most, most);
}

}  // namespace

// Both sides list states, reasons and goal kinds in the same order; a reordering must not compile.
static_assert(static_cast<int>(State::fault) == static_cast<int>(wire::PlannerState::fault));
static_assert(static_cast<int>(State::stuck) == static_cast<int>(wire::PlannerState::stuck));
static_assert(static_cast<int>(Reason::contact) == static_cast<int>(wire::Reason::contact));
static_assert(static_cast<int>(Reason::internal) == static_cast<int>(wire::Reason::internal));
static_assert(static_cast<int>(scene::GoalKind::joints) == static_cast<int>(wire::GoalKind::joints));

wire::PlannerState to_wire(State state) { return static_cast<wire::PlannerState>(state); }

scene::Goal from_wire(const wire::Goal& g) {
  scene::Goal out;
  out.id = g.id;
  out.kind = static_cast<scene::GoalKind>(g.kind);
  out.X_WG.p = g.position_m;
  const Eigen::Vector4d& x = g.orientation_xyzw;
  out.X_WG.R = Eigen::Quaterniond(x[3], x[0], x[1], x[2]).toRotationMatrix();
  out.V_WG = g.twist;
  out.joints = g.joints;
  return out;
}

void to_wire(const Report& r, wire::PlannerReport& out) {
  out.state = to_wire(r.state);
  out.reason = static_cast<wire::Reason>(r.reason);
  out.detail = r.detail;
  out.goal_id = r.goal_id;
  out.target_error_m = sayable(r.target_error_m);
  out.orientation_error_rad = sayable(r.orientation_error_rad);
  out.speed_mps = sayable(r.speed_mps);
  out.end_effector_m = r.end_effector_m;
  out.clearance_m = r.clearance_m;
  out.clearance_min_m = r.clearance_min_m;
  out.contacts = static_cast<std::uint32_t>(r.contacts);
  out.path_length_m = sayable(r.path_length_m);
  out.time_to_goal_s = r.time_to_goal_s;
  out.gyroscopic_power_W = sayable(r.gyroscopic_power_W);
  out.injected_power_W = sayable(r.injected_power_W);
  out.kinetic_J = sayable(r.kinetic_J);
  out.attraction_J = sayable(r.attraction_J);
  out.tank_J = sayable(r.tank_J);
  out.self_clearance_m = r.self_clearance_m;
  out.pairs_in_range = static_cast<std::uint32_t>(r.pairs_in_range);
  out.pairs_dropped = static_cast<std::uint32_t>(r.pairs_dropped);
  out.barrier_rows = static_cast<std::uint32_t>(r.barrier_rows);
  out.velocities_estimated = static_cast<std::uint32_t>(r.velocities_estimated);
  out.velocities_unknown = static_cast<std::uint32_t>(r.velocities_unknown);
  out.escapes = static_cast<std::uint32_t>(r.escapes);
  out.links.resize(r.links.size());
  for (std::size_t i = 0; i < r.links.size(); ++i) {
    const LinkReport& a = r.links[i];
    wire::LinkReport& b = out.links[i];
    b.link = a.link;
    b.obstacle = a.obstacle;
    b.distance_m = a.distance_m;
    b.point_on_link_m = a.point_on_link_m;
    b.point_on_obstacle_m = a.point_on_obstacle_m;
    b.closing_speed_mps = sayable(a.closing_speed_mps);
    b.phi_rad = sayable(a.phi_rad);
    b.gate = sayable(a.gate);
    b.gyroscopic_N = a.gyroscopic_N.unaryExpr(&sayable);
    b.repulsive_N = a.repulsive_N.unaryExpr(&sayable);
    b.barrier_multiplier = sayable(a.barrier_multiplier);
  }
}

}  // namespace hamel::planner
