#pragma once
/// The state machine: what the arm is doing and, where it does not get on, why.

#include "common/scene/options.h"
#include "services/planner/core/memory.h"
#include "services/planner/core/planner.h"

namespace hamel::planner {

/// A state, its reason, and one sentence.
struct Verdict {
  State state = State::idle;
  Reason reason = Reason::none;
  const char* detail = "";
};

/// What the monitor needs to know of a cycle in which nothing is unsafe.
struct Progress {
  double t_s = 0;
  double scaled_error = 0;  ///< within tolerance when <= 1
  double speed = 0;         ///< of the end effector, joints: the largest |qd|
  bool out_of_reach = false;
  bool target_blocked = false;  ///< an obstacle lies over the target
  bool at_joint_limit = false;  ///< the attraction presses a joint against its limit
  bool escaping = false;        ///< circulation still has a side to try, or the arm passes a waypoint
  bool has_rollouts = false;    ///< a way out can be asked for: no need to wait long
};

/// Forgets everything that belonged to the goal before.
void start_goal(Memory& memory, double t_s) noexcept;
/// The clocks of progress begin anew: the arm was sent elsewhere for a while.
void restart_progress(Memory& memory, double t_s) noexcept;
/// IDLE, MOVING, REACHED or STUCK, from what the memory knows; keeps the clocks.
///   REACHED  within tolerance and slow for goal_hold_s; left beyond twice the tolerance
///   STUCK    slow and the error has not fallen 10 % in progress_window_s; four windows without progress
///   while
///            moving (orbit); at once when out of reach.  Left by progress.
Verdict judge(const scene::PlannerOptions& o, Memory& memory, const Progress& now) noexcept;

}  // namespace hamel::planner
