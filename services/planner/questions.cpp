/// What the planner has thought about beside its loop: whether the arm can meet a goal, and ways out. Answers
/// enter at a step known beforehand, so that results do not depend on the threads' speed.

#include <cmath>

#include "services/planner/convert.h"
#include "services/planner/service.h"

namespace hamel::planner {

namespace {

constexpr double kLook_s = 0.02;  ///< from a goal to the answer whether it can be reached

}  // namespace

bool PlannerService::waits() const { return config_.pace == scene::Pace::lockstep || config_.patient; }

/// The newest goal.  Lockstep, and who drives no arm yet, looks at once whether it can be reached.  In real
/// time the arm keeps to the goal before until the answer is there; a target that only moves on is followed
/// meanwhile.
void PlannerService::pursue() {
  if (looked_at_ != goal_->id) reach_.forget();
  const auto question = planner_.reach_question(*goal_);
  if (!question || !have_state_ || config_.pace == scene::Pace::lockstep) {
    looking_ = false;
    planner_.set_goal(*goal_);
    return;
  }
  const bool moves_on = question->near.size() > 0;
  if (moves_on) planner_.set_goal(*goal_, planner_.reach());
  look_again_ = reach_.asked();  // who moves on faster than is looked is not kept waiting for ever
  if (look_again_) return;
  looking_ = !moves_on;
  looked_at_ = goal_->id;
  look_due_.reset();
  reach_.ask([this, question = *question](const std::function<bool()>& stop) {
    return reachability(scene_.robot.chain, question, scene_.planner, stop);
  });
}

/// The goal once more for a planner that begins afresh: what is known of it stays known.
void PlannerService::pursue_again(const Reachability& known) {
  look_due_.reset();
  if (!goal_ || looking_) return;
  if (config_.pace == scene::Pace::lockstep)
    planner_.set_goal(*goal_);
  else
    planner_.set_goal(*goal_, known);
}

/// In a cycle: the answer enters kLook_s after the first one that waited for it.
void PlannerService::take_look() {
  if (!reach_.asked()) return;
  const auto steps = static_cast<std::uint64_t>(std::ceil(kLook_s / scene_.dynamics.dt_s));
  if (!look_due_) look_due_ = state_.step + steps;
  if (state_.step >= *look_due_) enter_look(waits());
}

void PlannerService::enter_look(bool wait) {
  const auto found = reach_.take(wait);
  if (!found) return;
  if (looking_) escape_.forget();  // of the goal before
  looking_ = false;
  planner_.set_goal(*goal_, *found);
  if (look_again_) pursue();
}

/// Rollouts are many cycles' work: their answer enters escape_delay_s later.
void PlannerService::ask_escape(const Input& in) {
  question_ = planner_.escape_question(in);
  start_escape();
  if (output_.report.state == State::stuck)
    spdlog::info("t = {:.3f} s: stuck ({}); looking for a way out", in.t_s, to_string(output_.report.reason));
  else
    spdlog::info("t = {:.3f} s: little progress; looking for a quicker way", in.t_s);
}

void PlannerService::start_escape() {
  pack_question();
  escape_due_ = question_.step + planner_.escape_steps(scene_.dynamics.dt_s);
  escape_.ask([this, question = question_](const std::function<bool()>& stop) {
    return find_escape(scene_.robot, scene_.planner, question, stop);
  });
}

void PlannerService::take_escape() {
  const Waypoint& w = planner_.memory().waypoint;
  if (w.waiting != 0 && (!escape_.asked() || w.asked_step != question_.step)) {
    planner_.take_escape({}, state_.t_s);  // nobody thinks about it: it will be asked again
    return;
  }
  if (state_.step < escape_due_) return;
  const auto answer = escape_.take(waits());
  if (!answer || w.waiting == 0) return;  // another goal meanwhile
  const Escape& escape = *answer;
  if (escape.found)
    spdlog::info("t = {:.3f} s: waypoint {} leads out; goal expected in {:.1f} s", state_.t_s,
                 escape.rollouts, escape.reached_after_s);
  else if (escape.rollouts > 0)
    spdlog::info("t = {:.3f} s: {} rollouts found no way out", state_.t_s, escape.rollouts);
  else
    spdlog::info("t = {:.3f} s: the way it goes leads to the goal", state_.t_s);
  planner_.take_escape(escape.waypoint, state_.t_s);
}

}  // namespace hamel::planner
