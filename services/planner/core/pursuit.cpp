// How the goal stands, and where the arm is sent.
#include <algorithm>
#include <cmath>

#include "services/planner/core/holds.h"
#include "services/planner/core/planner_impl.h"
#include "services/planner/core/reachable.h"

namespace hamel::planner {

using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::Method;

namespace {

constexpr double kLag_s = 1;  // without progress for so long an arm that moves asks for a quicker way
constexpr double kNearEnough =
    10;  // tolerances from the place nearest to a target out of reach: no more detours
constexpr double kNearWaypoint = 0.15, kWaypoint_s = 4;  // a waypoint is passed [rad or m], or given up

}  // namespace

bool Planner::Impl::fits(const scene::Goal& wanted) const noexcept {
  if (wanted.kind == scene::GoalKind::joints)
    return wanted.joints.size() == arm.n() && wanted.joints.allFinite();
  return wanted.X_WG.p.allFinite() && wanted.X_WG.R.allFinite() && wanted.V_WG.allFinite();
}

// Where to send an arm that cannot meet the goal.
void Planner::Impl::pursue(const scene::Goal& wanted, const Reachability& found) {
  goal = wanted;
  goal_fits = fits(wanted);
  const bool approaches = options.unreachable == scene::Unreachable::approach;
  if (!goal_fits || wanted.kind == scene::GoalKind::joints) {
    goal_reachable = !goal_fits || !Attraction::beyond_limits(arm, wanted);
    beyond_W.setZero();
    if (!goal_reachable && approaches) Attraction::clamp_to_limits(arm, goal);
    if (goal_fits) pairs.set_goal(arm.chain, goal.joints);
  } else {
    reach = found;
    goal_reachable = reach.reachable;
    beyond_W = reach.reachable ? Vector3d(Vector3d::Zero()) : Vector3d(wanted.X_WG.p - reach.nearest_W);
    looked = true;
  }
  sought = wanted;
  if (!goal_reachable && approaches) goal.X_WG.p -= beyond_W;
}

// The command of a cycle in which nothing is unsafe, and how the goal stands.
Verdict Planner::Impl::move(const Input& in, VectorXd& tau) noexcept {
  const bool steered = has_goal;
  Verdict verdict{State::idle, Reason::none, "no goal"};
  tau_att.setZero();
  bool refused = false;
  if (steered) {
    if (!memory.goal_started) start_goal(memory, in.t_s);
    attraction.update(arm, goal, in.t_s - memory.goal_start_s, slow_down(in));
    goal_error = attraction.error();
    const bool joints = goal.kind == scene::GoalKind::joints;
    if (joints) goal_error.position_m = (sought.joints - arm.q).lpNorm<Eigen::Infinity>();
    target_W = attraction.target_W();
    Progress now;
    now.t_s = in.t_s;
    now.scaled_error = attraction.error().scaled;
    now.speed = joints ? arm.qd.lpNorm<Eigen::Infinity>() : tip_speed;
    now.out_of_reach =
        (!goal_reachable && !approaching()) ||
        (!joints && (attraction.target_W() - arm.shoulder_W).norm() > arm.reach_m + options.goal_tolerance_m);
    now.target_blocked = target_is_blocked = target_blocked(false);
    const bool rejects = options.unreachable == scene::Unreachable::reject;
    refused =
        now.target_blocked && rejects && !now.out_of_reach && goal.V_WG.isZero(0) && target_blocked(true);
    now.at_joint_limit = attraction.blocked_joint(arm) >= 0;
    const bool rollouts = options.method == Method::gyro && options.escapes > 0;
    const std::uint64_t flips = rollouts ? 1 : kFlips;
    now.escaping = options.method == Method::gyro && options.kc > 0 && memory.flips < flips &&
                   in.t_s - memory.pressed_s <= kTurnHold_s;
    now.has_rollouts = rollouts;
    if (!pass_waypoint(in))
      verdict = approaching() ? approached(judge(options, memory, now)) : judge(options, memory, now);
    else
      verdict = {State::moving, Reason::none, "escaping by way of a waypoint that rollouts found"};
    if (refused) verdict = {State::stuck, Reason::goal_blocked, "an obstacle stands over the target"};
    asked = ask_for_escape(in, verdict);
    refused |= verdict.reason == Reason::unreachable && !approaching();
  }
  steer(in, refused, tau);
  if (options.method == Method::gyro && guard(in, tau)) {
    memory.infeasible_s = in.t_s;
    if (outcome.torque_bound)
      return {State::unsafe, Reason::torque_limit, "the joints are too weak to keep all distances: braking"};
    return {State::unsafe, Reason::infeasible, "no acceleration keeps all distances: braking"};
  }
  return verdict;
}

bool Planner::Impl::near_enough() const noexcept {
  return approaching() && memory.goal_started && memory.best_error <= kNearEnough;
}

// The place nearest to a target out of reach is no goal: who is there is stuck.
Verdict Planner::Impl::approached(Verdict verdict) noexcept {
  if (verdict.state == State::reached) memory.time_to_goal_s = -1;
  if (verdict.state == State::reached || verdict.state == State::stuck)
    return {State::stuck, Reason::unreachable, "as near as the arm comes to a target out of reach"};
  return verdict;
}

// While a waypoint is set the arm is drawn to it instead of the goal: until near it, or for no longer than
// kWaypoint_s.
bool Planner::Impl::pass_waypoint(const Input& in) noexcept {
  Waypoint& w = memory.waypoint;
  if (!w.set) return false;
  std::copy_n(w.q.begin(), arm.n(), waypoint.joints.begin());
  const bool near = (waypoint.joints - arm.q).lpNorm<Eigen::Infinity>() < kNearWaypoint;
  if (near || in.t_s - w.since_s > kWaypoint_s || in.t_s < w.since_s) {
    w.set = 0;
    restart_progress(memory, in.t_s);
    return false;
  }
  attraction.update(arm, waypoint, 0, slow_down(in));
  return true;
}

// Where only another way helps, and there are questions left.
bool Planner::Impl::ask_for_escape(const Input& in, const Verdict& verdict) noexcept {
  Waypoint& w = memory.waypoint;
  const bool curable = verdict.reason == Reason::local_minimum || verdict.reason == Reason::joint_limit ||
                       verdict.reason == Reason::orbit;
  const bool lags = verdict.state == State::moving && !w.set && !target_is_blocked &&
                    in.t_s - std::max(memory.progress_s, w.asked_s) >= kLag_s;
  const bool ask = options.method == Method::gyro && (curable || lags) && !near_enough() && !w.waiting &&
                   w.asked < static_cast<std::uint64_t>(options.escapes) &&
                   arm.n() <= static_cast<int>(kMaxWaypoint);
  if (!ask) return false;
  w.waiting = 1;
  ++w.asked;
  w.asked_step = in.step;
  w.asked_s = in.t_s;
  return true;
}

// Full speed up to stale_slow_s, none at stale_brake_s.
double Planner::Impl::slow_down(const Input& in) const noexcept {
  const double age = in.obstacles.empty() && in.obstacle_age_s == scene::kInf ? 0.0 : in.obstacle_age_s;
  const double span = options.stale_brake_s - options.stale_slow_s;
  return span > 0 ? std::clamp(1 - (age - options.stale_slow_s) / span, 0.0, 1.0) : 1.0;
}

// An obstacle has no room beside it for the last link at the target, or for any link at a joint goal; for
// good: it stands, and no place within the tolerance has room either.
bool Planner::Impl::target_blocked(bool for_good) const noexcept {
  const bool joints = goal.kind == scene::GoalKind::joints, turns = goal.kind != scene::GoalKind::pose;
  const double dmin = options.method == Method::gyro && options.barrier_gain > 0 ? options.dmin_m : 0;
  const double slack = for_good ? options.goal_tolerance_m : 0;
  const auto items = obstacles.items();
  return std::any_of(items.begin(), items.end(), [&](const Obstacles::Item& item) {
    if (for_good && !(item.now.velocity_known && item.now.V_WO.isZero(0))) return false;
    const double margin_m = item.inflation_m + dmin;
    if (joints) return pairs.blocks_goal(item, margin_m, for_good);
    return pairs.blocks(item, attraction.target(), turns, margin_m - slack);
  });
}

}  // namespace hamel::planner
