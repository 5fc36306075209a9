#include "services/planner/core/report.h"

#include <array>

#include "services/planner/core/force_law.h"

namespace hamel::planner {

void report_links(const Pairs& pairs, const scene::PlannerOptions& options, Report& out) noexcept {
  out.links.resize(pairs.nearest().size());
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    LinkReport& link = out.links[i];
    link = LinkReport{};
    link.link = static_cast<std::uint32_t>(i);
    const Pairs::Nearest& nearest = pairs.nearest()[i];
    if (!nearest.item) continue;
    link.obstacle = nearest.item->now.id;
    link.distance_m = nearest.at.distance_m;
    link.point_on_link_m = nearest.at.on_link;
    link.point_on_obstacle_m = nearest.at.on_obstacle;
  }
  for (const Pair& pair : pairs.items()) {
    LinkReport& link = out.links[static_cast<std::size_t>(pair.link)];
    const Pairs::Nearest& nearest = pairs.nearest()[static_cast<std::size_t>(pair.link)];
    if (pair.item != nearest.item || pair.shape != nearest.shape) continue;
    link.closing_speed_mps = pair.n.dot(pair.v_relative);
    link.phi_rad = approach_angle(pair.n, pair.v_relative);
    link.gate = gate(options, pair.n, pair.d, pair.v_relative);
    link.gyroscopic_N = pair.gyroscopic;
    link.repulsive_N = pair.repulsive;
    link.barrier_multiplier = pair.multiplier;
  }
}

const char* to_string(State v) noexcept {
  static constexpr std::array names{"IDLE", "MOVING", "REACHED", "STUCK", "UNSAFE", "FAULT"};
  return names[static_cast<std::size_t>(v)];
}

const char* to_string(Reason v) noexcept {
  static constexpr std::array names{"none",        "local_minimum", "joint_limit", "goal_blocked",
                                    "unreachable", "orbit",         "contact",     "stale_obstacles",
                                    "stale_state", "infeasible",    "non_finite",  "torque_limit",
                                    "driver",      "configuration", "internal"};
  return names[static_cast<std::size_t>(v)];
}

}  // namespace hamel::planner
