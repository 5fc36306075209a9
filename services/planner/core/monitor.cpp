#include "services/planner/core/monitor.h"

#include <limits>

namespace hamel::planner {
namespace {

constexpr double kProgress = 0.9;    // the error must fall to this part of the best so far
constexpr double kSlowFor_s = 0.5;   // slow this long counts as standing
constexpr double kOrbitWindows = 4;  // windows without progress before motion is called an orbit
constexpr double kLeaveReached = 2;  // tolerances

void restart_clocks(Memory& m, const Progress& now) {
  m.best_error = m.turn_error = now.scaled_error;
  m.progress_s = m.turn_s = now.t_s;
  m.flips = 0;
}

// What of the arm holds it up is said once and kept: an arm that hardly moves would change it all the time.
Verdict stuck(const Progress& now, bool moving, Reason held = Reason::none) {
  if (now.target_blocked) return {State::stuck, Reason::goal_blocked, "an obstacle lies over the target"};
  const bool keeps = held == Reason::joint_limit || held == Reason::orbit || held == Reason::local_minimum;
  if (keeps ? held == Reason::joint_limit : now.at_joint_limit)
    return {State::stuck, Reason::joint_limit, "a joint at its limit is in the way"};
  if (keeps ? held == Reason::orbit : moving)
    return {State::stuck, Reason::orbit, "the arm moves without coming nearer"};
  return {State::stuck, Reason::local_minimum, "attraction and obstacles hold each other"};
}

}  // namespace

void restart_progress(Memory& m, double t_s) noexcept {
  m.progress_s = m.turn_s = m.fast_s = t_s;
  m.best_error = m.turn_error = std::numeric_limits<double>::max();
  m.flips = 0;
}

void start_goal(Memory& m, double t_s) noexcept {
  m.goal_started = 1;
  m.goal_start_s = m.progress_s = m.turn_s = m.fast_s = t_s;
  m.within_since_s = m.time_to_goal_s = -1;
  m.best_error = m.turn_error = 0;  // set by the first judgement
  m.flips = 0;
  m.waypoint = {};
  m.tank_J = 0;
  m.tank_full_J = -1;
  m.held_count = m.turn_count = 0;
  m.held.fill({});
  m.turns.fill({});
  m.state = static_cast<std::uint64_t>(State::idle);
}

Verdict judge(const scene::PlannerOptions& o, Memory& m, const Progress& now) noexcept {
  const State before = static_cast<State>(m.state);
  const bool slow = now.speed < o.goal_speed, within = now.scaled_error <= 1;
  if (!slow) m.fast_s = now.t_s;
  if (before == State::idle || before == State::unsafe) restart_clocks(m, now);

  if (before == State::reached && now.scaled_error <= kLeaveReached)
    return {State::reached, Reason::none, "at the goal"};
  if (before == State::reached) restart_clocks(m, now);
  if (!(within && slow))
    m.within_since_s = -1;
  else if (m.within_since_s < 0)
    m.within_since_s = now.t_s;
  if (m.within_since_s >= 0 && now.t_s - m.within_since_s >= o.goal_hold_s) {
    if (m.time_to_goal_s < 0) m.time_to_goal_s = m.within_since_s - m.goal_start_s;
    return {State::reached, Reason::none, "at the goal"};
  }

  if (now.out_of_reach)
    return {State::stuck, Reason::unreachable, "no configuration of the arm meets the target"};
  const bool progress = now.scaled_error < kProgress * m.best_error;
  if (progress || (within && slow)) restart_clocks(m, now);
  const double idle_s = now.t_s - m.progress_s;
  const bool stands = now.t_s - m.fast_s >= kSlowFor_s;
  if (before == State::stuck && !progress) {
    const Reason reason = static_cast<Reason>(m.reason);
    if (reason != Reason::unreachable) return stuck(now, !stands, reason);
  }
  if (idle_s >= o.progress_window_s && stands && !now.escaping) return stuck(now, false);
  const double windows = now.has_rollouts ? 1 : kOrbitWindows;
  if (idle_s >= windows * o.progress_window_s && !now.escaping) return stuck(now, true);
  return {State::moving, Reason::none, "on its way"};
}

}  // namespace hamel::planner
