#include "services/planner/core/planner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "services/planner/core/escape.h"
#include "services/planner/core/holds.h"
#include "services/planner/core/planner_impl.h"
#include "services/planner/core/reachable.h"
#include "services/planner/core/report.h"

namespace hamel::planner {

using Eigen::Vector3d;
using Eigen::VectorXd;

Planner::Planner(const scene::Robot& robot, const Options& options, const Savings& savings)
    : impl_(std::make_unique<Impl>(robot, options, savings)) {}
Planner::~Planner() = default;
Planner::Planner(Planner&&) noexcept = default;
Planner& Planner::operator=(Planner&&) noexcept = default;

Output Planner::output() const {
  Output out;
  out.torque_Nm = VectorXd::Zero(impl_->arm.n());
  out.report.links.resize(static_cast<std::size_t>(impl_->arm.n()));
  return out;
}

void Planner::set_goal(const scene::Goal& goal) {
  const auto question = reach_question(goal);
  set_goal(goal, question ? reachability(impl_->arm.chain, *question, impl_->options) : reach());
}

void Planner::set_goal(const scene::Goal& goal, const Reachability& found) {
  Impl& p = *impl_;
  p.has_goal = true;
  p.pursue(goal, found);
  if (goal.id != p.memory.goal_id) p.memory.goal_started = 0;
  p.memory.goal_id = goal.id;
}

std::optional<ReachQuestion> Planner::reach_question(const scene::Goal& goal) const {
  const Impl& p = *impl_;
  if (goal.kind == scene::GoalKind::joints || !p.fits(goal)) return {};
  const lie::Pose &X = goal.X_WG, &before = p.sought.X_WG;
  const bool known = p.looked && goal.id == p.memory.goal_id && goal.kind == p.sought.kind;
  if (known && X.p == before.p && X.R == before.R) return {};
  return ReachQuestion{goal, known ? p.arm.q : VectorXd()};
}

const Reachability& Planner::reach() const noexcept { return impl_->reach; }

void Planner::clear_goal() {
  impl_->has_goal = false;
  impl_->memory.goal_id = impl_->memory.goal_started = 0;
}

void Planner::ramp_in() noexcept { impl_->memory.ramp_asked = 1; }

EscapeQuestion Planner::escape_question(const Input& in) const {
  const Impl& p = *impl_;
  const double goal_age_s = in.t_s - p.memory.goal_start_s;
  EscapeQuestion question{in.step,           in.q,   in.qd,      {},
                          in.obstacle_age_s, p.goal, goal_age_s, p.memory.waypoint.asked};
  question.stuck = static_cast<State>(p.memory.state) == State::stuck;
  // As the planner sees them: one of unknown velocity goes on with the estimated one.
  Obstacles seen = p.obstacles;
  Memory memory = p.memory;
  seen.take(in.obstacles, in.t_s, in.obstacle_age_s, p.options, memory);
  for (const Obstacles::Item& item : seen.items()) {
    question.obstacles.push_back(item.now);
    question.obstacles.back().velocity_known = true;
  }
  question.obstacle_age_s = 0;
  return question;
}

std::uint64_t Planner::escape_steps(double dt_step_s) const noexcept {
  return static_cast<std::uint64_t>(std::ceil(impl_->options.escape_delay_s / dt_step_s));
}

void Planner::take_escape(const VectorXd& waypoint, double t_s) noexcept {
  Impl& p = *impl_;
  Waypoint& w = p.memory.waypoint;
  w.waiting = 0;
  if (waypoint.size() != p.arm.n() || waypoint.size() > static_cast<Eigen::Index>(kMaxWaypoint)) return;
  w.set = 1;
  w.since_s = t_s;
  std::copy_n(waypoint.data(), waypoint.size(), w.q.begin());
}

const Memory& Planner::memory() const noexcept { return impl_->memory; }
void Planner::restore(const Memory& memory) noexcept { impl_->memory = memory; }

void Planner::plan(const Input& in, Output& out) noexcept {
  Impl& p = *impl_;
  out.torque_Nm.setZero(p.arm.n());
  ++p.memory.cycles;
  Verdict verdict = p.see(in);
  const bool readable = verdict.state != State::fault && verdict.reason != Reason::non_finite;
  if (readable && verdict.state == State::moving)
    verdict = p.move(in, out.torque_Nm);
  else if (p.arm.q.allFinite())
    p.brake(in.dt_s, out.torque_Nm);
  if (!out.torque_Nm.allFinite()) {
    out.torque_Nm.setZero();
    verdict = {State::unsafe, Reason::non_finite, "the arithmetic left the finite numbers"};
  }
  p.memory.state = static_cast<std::uint64_t>(verdict.state);
  p.memory.reason = static_cast<std::uint64_t>(verdict.reason);
  p.report(verdict, out.report);
}

// Takes the input in and says why the arm may not move, or MOVING.
Verdict Planner::Impl::see(const Input& in) noexcept {
  gyro.clear_power();
  asked = false;
  outcome = {};
  pairs.clear();
  if (in.q.size() != arm.n() || in.qd.size() != arm.n()) {
    arm.q.setConstant(std::nan(""));
    return {State::fault, Reason::internal, "joint count differs from the robot's"};
  }
  if (!in.q.allFinite() || !in.qd.allFinite() || !std::isfinite(in.t_s)) {
    arm.q.setConstant(std::nan(""));
    return {State::unsafe, Reason::non_finite, "the arm's state is not finite"};
  }
  lag_s = in.state_age_s > std::min(2 * in.dt_s, kFresh_s) && in.state_age_s <= options.stale_state_s
              ? in.state_age_s
              : 0;
  q_now = in.q + lag_s * in.qd;
  arm.look(q_now, in.qd);
  remember_tip();
  obstacles.take(in.obstacles, in.t_s + lag_s, in.obstacle_age_s + lag_s, options, memory, in.obstacle_set);
  pairs.find(arm, obstacles, in.link_floor_m);
  memory.clearance_min_m = std::min(memory.clearance_min_m, pairs.clearance_m());
  const bool self_contact = pairs.self_clearance_m() < 0;
  const bool contact = pairs.clearance_m() < 0 || self_contact;
  memory.contacts += contact;
  prepare(in);

  const bool was_contact = static_cast<Reason>(memory.reason) == Reason::contact;
  if (!(in.dt_s >= kLeastPeriod_s) || !std::isfinite(in.dt_s))
    return {State::fault, Reason::configuration, "the command period is not a positive number"};
  if (has_goal && !goal_fits) return {State::fault, Reason::configuration, "the goal does not fit the robot"};
  if (obstacles.too_many()) return {State::fault, Reason::internal, "more obstacles than the planner holds"};
  if (self_contact) return {State::unsafe, Reason::contact, "two links touch"};
  if (pairs.base_touched())
    return {State::unsafe, Reason::contact, "an obstacle has come to the base, which cannot give way"};
  if (contact) return {State::unsafe, Reason::contact, "a link touches an obstacle"};
  if (was_contact && std::min(pairs.clearance_m(), pairs.self_clearance_m()) < options.dmin_m)
    return {State::unsafe, Reason::contact, "a link has touched something and is still too near"};
  if (!obstacles.all_finite()) return {State::unsafe, Reason::non_finite, "an obstacle is not finite"};
  if (!(in.state_age_s <= options.stale_state_s))
    return {State::unsafe, Reason::stale_state, "the arm's state is old"};
  if (in.obstacle_age_s == scene::kInf && in.obstacles.empty()) {
    if (!in.obstacles_expected) return {State::moving};
    return {State::idle, Reason::stale_obstacles, "waiting for the first obstacle set"};
  }
  if (!(in.obstacle_age_s <= options.stale_brake_s))
    return {State::unsafe, Reason::stale_obstacles, "the obstacles are old"};
  return {State::moving};
}

void Planner::Impl::remember_tip() noexcept {
  if (memory.tip_known) memory.path_length_m += (arm.X_WE.p - vector(memory.tip_m)).norm();
  memory.tip_known = 1;
  memory.tip_m = triple(arm.X_WE.p);
  tip_speed = arm.V_WE.tail<3>().norm();
}

void Planner::Impl::report(const Verdict& verdict, Report& out) noexcept {
  out.state = verdict.state;
  out.reason = verdict.reason;
  out.detail = verdict.detail;
  out.speed_mps = tip_speed;
  out.end_effector_m = vector(memory.tip_m);
  out.goal_id = has_goal ? goal.id : 0;
  const bool joints = goal.kind == scene::GoalKind::joints;
  const Vector3d rest = approaching() ? beyond_W : Vector3d(0, 0, 0);
  out.target_error_m = !has_goal ? 0
                       : joints  ? goal_error.position_m
                                 : (target_W + rest - out.end_effector_m).norm();
  out.orientation_error_rad = has_goal ? goal_error.angle_rad : 0;
  out.clearance_m = pairs.clearance_m();
  out.clearance_min_m = memory.clearance_min_m;
  out.self_clearance_m = pairs.self_clearance_m();
  out.contacts = memory.contacts;
  out.path_length_m = memory.path_length_m;
  out.time_to_goal_s = memory.time_to_goal_s;
  out.gyroscopic_power_W = gyro.gyroscopic_power_W();
  out.injected_power_W = gyro.injected_power_W();
  out.kinetic_J = arm.q.allFinite() ? 0.5 * arm.qd.dot(arm.momentum) : 0;
  out.attraction_J = has_goal ? attraction.potential_J() : 0;
  out.tank_J = memory.tank_J;
  out.pairs_in_range = static_cast<int>(pairs.items().size());
  out.pairs_dropped = pairs.dropped();
  out.velocities_estimated = obstacles.velocities_estimated();
  out.velocities_unknown = obstacles.velocities_unknown();
  out.escape_asked = asked;
  out.escape_waiting = memory.waypoint.waiting != 0;
  out.escapes = memory.waypoint.asked;
  out.barrier_rows = outcome.rows;
  report_links(pairs, options, out);
}

}  // namespace hamel::planner
