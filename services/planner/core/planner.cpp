#include "services/planner/core/planner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "services/planner/core/arm.h"
#include "services/planner/core/attraction.h"
#include "services/planner/core/barrier.h"
#include "services/planner/core/escape.h"
#include "services/planner/core/force_law.h"
#include "services/planner/core/gyro.h"
#include "services/planner/core/holds.h"
#include "services/planner/core/monitor.h"
#include "services/planner/core/pairs.h"
#include "services/planner/core/reachable.h"
#include "services/planner/core/report.h"

namespace hamel::planner {

using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::Method;

namespace {

constexpr std::uint64_t kFlips = 2;  // sides tried before an arm that circulates is called stuck
constexpr double kFade_s = 0.5;      // circulation comes back over it after the barrier was infeasible
constexpr double kLeastPeriod_s = 1e-6;
constexpr double kNearWaypoint = 0.15, kWaypoint_s = 4;  // a waypoint is passed [rad or m], or given up

}  // namespace

struct Planner::Impl {
  Impl(const scene::Robot& robot, const Options& o, const Savings& savings)
      : options(o),
        arm(robot.chain),
        attraction(arm, options),
        gyro(arm, options),
        barrier(arm, options),
        obstacles(workspace(robot)),
        pairs(robot, options, savings),
        tau_att(VectorXd::Zero(arm.n())),
        qdd_att(tau_att),
        qdd(tau_att),
        scratch(kMaxPairs) {
    waypoint.kind = scene::GoalKind::joints;
    waypoint.joints = tau_att;
    if (options.method == Method::gyro &&
        options.barrier_gain > 0)  // the barrier must see an obstacle in time
      options.vmax_mps = std::min(options.vmax_mps, options.barrier_gain * options.rho0_m);
  }

  Verdict see(const Input& in) noexcept;
  void prepare(const Input& in) noexcept;
  Verdict move(const Input& in, VectorXd& tau) noexcept;
  void steer(const Input& in, bool unreachable, VectorXd& tau) noexcept;
  void circulate(const Input& in, VectorXd& tau) noexcept;
  double open_tank(double dt_s) noexcept;
  bool guard(const Input& in, VectorXd& tau) noexcept;
  void brake(double dt_s, VectorXd& tau) const noexcept;
  void report(const Verdict& verdict, Report& out) noexcept;
  double slow_down(const Input& in) const noexcept;
  void look_for_a_way(const scene::Goal& wanted);
  Verdict approached(Verdict verdict) noexcept;
  bool approaching() const noexcept {
    return !goal_reachable && options.unreachable == scene::Unreachable::approach;
  }
  bool target_blocked() const noexcept;
  void remember_tip() noexcept;
  bool pass_waypoint(const Input& in) noexcept;
  bool ask_for_escape(const Input& in, const Verdict& verdict) noexcept;

  Options options;
  Arm arm;
  Attraction attraction;
  Gyro gyro;
  Barrier barrier;
  Obstacles obstacles;
  Pairs pairs;
  Barrier::Outcome outcome;
  VectorXd tau_att, qdd_att, qdd;
  std::vector<HeldPair> scratch;
  scene::Goal goal, sought;              // `sought` as it came
  scene::Goal waypoint;                  // as a goal
  Vector3d beyond_W = Vector3d::Zero();  // from where the arm is sent to a target out of reach
  bool has_goal = false, goal_fits = true, goal_reachable = true, looked = false, asked = false;
  GoalError goal_error;
  Vector3d target_W = Vector3d::Zero();
  double tip_speed = 0;
  double pull_share = 1;  // of the attraction that ramp and amax let through
  Memory memory;
};

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
  Impl& p = *impl_;
  const bool joints = goal.kind == scene::GoalKind::joints;
  p.goal = goal;
  p.has_goal = true;
  p.goal_fits = joints ? goal.joints.size() == p.arm.n() && goal.joints.allFinite()
                       : goal.X_WG.p.allFinite() && goal.X_WG.R.allFinite() && goal.V_WG.allFinite();
  p.look_for_a_way(goal);
  if (goal.id != p.memory.goal_id) p.memory.goal_started = 0;
  p.memory.goal_id = goal.id;
}

// Whether the arm can meet the goal at all, and where to send it if not.
void Planner::Impl::look_for_a_way(const scene::Goal& wanted) {
  const bool same = wanted.id == memory.goal_id && wanted.kind == sought.kind &&
                    wanted.X_WG.p == sought.X_WG.p && wanted.X_WG.R == sought.X_WG.R;
  if (!goal_fits || wanted.kind == scene::GoalKind::joints) {
    goal_reachable = true;
    beyond_W.setZero();
  } else if (!same || !looked) {
    const Reach found = reach(arm.chain, wanted, options);
    goal_reachable = found.reachable;
    beyond_W = found.reachable ? Vector3d(Vector3d::Zero()) : Vector3d(wanted.X_WG.p - found.nearest_W);
    looked = true;
  }
  sought = wanted;
  if (!goal_reachable && options.unreachable == scene::Unreachable::approach) goal.X_WG.p -= beyond_W;
}

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
  arm.look(in.q, in.qd);
  remember_tip();
  obstacles.take(in.obstacles, in.t_s, in.obstacle_age_s, options, memory, in.obstacle_set);
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

// Brings arm and pairs to where the forces are evaluated.  The torque holds for a whole period, so `gyro`
// takes the middle of it: at dt 1 ms its barrier then keeps 96 % of dmin in example 5.2 instead of 87 %, at
// 10 ms 91 instead of 53 %.  The paper's methods take its beginning, as published.
void Planner::Impl::prepare(const Input& in) noexcept {
  const bool ahead = options.method == Method::gyro && in.dt_s > 0 && std::isfinite(in.dt_s);
  if (ahead) {
    qdd = in.q + 0.5 * in.dt_s * in.qd;
    arm.update(qdd, in.qd);
    pairs.advance(arm, 0.5 * in.dt_s);
  } else {
    arm.update(in.q, in.qd);
  }
  pairs.complete(arm);
}

// The command of a cycle in which nothing is unsafe, and how the goal stands.
Verdict Planner::Impl::move(const Input& in, VectorXd& tau) noexcept {
  const bool steered = has_goal;
  Verdict verdict{State::idle, Reason::none, "no goal"};
  tau_att.setZero();
  if (steered) {
    if (!memory.goal_started) start_goal(memory, in.t_s);
    attraction.update(arm, goal, in.t_s - memory.goal_start_s, slow_down(in));
    goal_error = attraction.error();
    target_W = attraction.target_W();
    Progress now;
    now.t_s = in.t_s;
    now.scaled_error = attraction.error().scaled;
    const bool joints = goal.kind == scene::GoalKind::joints;
    now.speed = joints ? arm.qd.lpNorm<Eigen::Infinity>() : tip_speed;
    now.out_of_reach =
        joints ? attraction.beyond_limits(arm, goal)
               : (!goal_reachable && !approaching()) ||
                     (attraction.target_W() - arm.shoulder_W).norm() > arm.reach_m + options.goal_tolerance_m;
    now.target_blocked = !joints && target_blocked();
    now.at_joint_limit = attraction.blocked_joint(arm) >= 0;
    const bool rollouts = options.method == Method::gyro && options.escapes > 0;
    const std::uint64_t flips = rollouts ? 1 : kFlips;
    now.escaping =
        options.method == Method::gyro && options.kc > 0 && memory.turn_count > 0 && memory.flips < flips;
    now.has_rollouts = rollouts;
    if (!pass_waypoint(in))
      verdict = approaching() ? approached(judge(options, memory, now)) : judge(options, memory, now);
    else
      verdict = {State::moving, Reason::none, "escaping by way of a waypoint that rollouts found"};
    asked = ask_for_escape(in, verdict);
  }
  steer(in, verdict.reason == Reason::unreachable && !approaching(), tau);
  if (options.method == Method::gyro && guard(in, tau)) {
    memory.infeasible_s = in.t_s;
    if (outcome.torque_bound)
      return {State::unsafe, Reason::torque_limit, "the joints are too weak to keep all distances: braking"};
    return {State::unsafe, Reason::infeasible, "no acceleration keeps all distances: braking"};
  }
  return verdict;
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
  const bool ask = options.method == Method::gyro && verdict.state == State::stuck && curable && !w.waiting &&
                   w.asked < static_cast<std::uint64_t>(options.escapes) &&
                   arm.n() <= static_cast<int>(kMaxWaypoint);
  if (!ask) return false;
  w.waiting = 1;
  ++w.asked;
  w.asked_step = in.step;
  return true;
}

// tau = attraction - bj M qd + forces of the obstacles.
void Planner::Impl::steer(const Input& in, bool unreachable, VectorXd& tau) noexcept {
  if (has_goal && !unreachable) tau_att = attraction.torque();
  if (memory.ramp_asked) memory.ramp_start_s = in.t_s, memory.ramp_asked = 0;
  const bool ramping = memory.ramp_start_s >= 0 && options.ramp_s > 0;
  const double ramped = ramping ? std::clamp((in.t_s - memory.ramp_start_s) / options.ramp_s, 0.0, 1.0) : 1;
  tau_att *= ramped;
  qdd_att = tau_att;
  pull_share = ramped;
  arm.M_llt.solveInPlace(qdd_att);
  const double most = qdd_att.lpNorm<Eigen::Infinity>();
  if (most > options.amax) {
    pull_share *= options.amax / most;
    tau_att *= options.amax / most;
    qdd_att *= options.amax / most;
  }
  tau.noalias() = -options.damping * (arm.M * arm.qd);
  tau += tau_att;
  if (options.method == Method::khatib) {
    for (std::size_t k = 0; k < pairs.items().size(); ++k) {
      Pair& pair = pairs.items()[k];
      pair.repulsive = pair.Lam * khatib_force(options, pair.n, pair.d);
      tau.noalias() += pairs.J(k).transpose().lazyProduct(pair.repulsive);
    }
  }
  if (options.method == Method::gyro) {
    gyro.choose_axes(pairs, memory, in.t_s, qdd_att);
    circulate(in, tau);
    remember_pairs(memory, pairs.items(), in.t_s, scratch);
  }
  if (options.method == Method::gyro || options.method == Method::gyro_paper)
    gyro.add(arm, pairs, in.dt_s, tau);
}

// Circulation is not powerless: it spends from a tank that holds the pull's energy at the start and is filled
// by what damping and the pull's own braking take out.  1: open; it closes smoothly over the last tenth.
double Planner::Impl::open_tank(double dt_s) noexcept {
  if (memory.tank_full_J < 0) memory.tank_J = memory.tank_full_J = attraction.potential_J();
  qdd.noalias() = arm.M * arm.qd;
  const double taken_W =
      options.damping * arm.qd.dot(qdd) + pull_share * std::max(attraction.braking_W(), 0.0);
  memory.tank_J = std::clamp(memory.tank_J + dt_s * taken_W, 0.0, memory.tank_full_J);
  return memory.tank_full_J > 0 ? smooth_step(10 * memory.tank_J / memory.tank_full_J) : 0;
}

// Held-direction circulation with its flip timer; 1.8.
void Planner::Impl::circulate(const Input& in, VectorXd& tau) noexcept {
  const double t_s = in.t_s;
  if (!(options.kc > 0) || !has_goal) return;
  const double fade = std::clamp((t_s - memory.infeasible_s) / kFade_s, 0.0, 1.0);
  const double kc = fade * open_tank(in.dt_s) * options.kc;
  const bool pressed = gyro.add_circulation(pairs, memory, t_s, kc, qdd_att, tau);
  memory.tank_J -= std::max(gyro.circulation_power_W(), 0.0) * in.dt_s;
  const double error = attraction.error().scaled;
  if (pressed) memory.pressed_s = t_s;
  const bool clear = t_s - memory.pressed_s > kTurnHold_s;
  if (clear || error < 0.9 * memory.turn_error || memory.turn_error == 0) {
    memory.turn_error = error;
    memory.turn_s = t_s;
  } else if (t_s - memory.turn_s >= options.flip_time_s) {
    for (std::size_t k = 0; k < memory.turn_count; ++k)
      for (double& e : memory.turns[k].axis) e = -e;
    ++memory.flips;
    memory.turn_error = error;
    memory.turn_s = t_s;
    memory.progress_s = t_s;  // the other side gets its own window
  }
}

// The barrier over the wanted torque; true where it had to give up and brakes.
bool Planner::Impl::guard(const Input& in, VectorXd& tau) noexcept {
  if (!(options.barrier_gain > 0)) return false;
  qdd = tau - arm.coriolis;
  arm.M_llt.solveInPlace(qdd);
  outcome = barrier.solve(arm, pairs, in.dt_s, qdd);
  if (outcome.infeasible) {
    qdd = -options.brake_rate * arm.qd;
    (void)barrier.solve(arm, pairs, in.dt_s, qdd);
  }
  if (outcome.active || outcome.infeasible) tau.noalias() = arm.coriolis + arm.M * qdd;
  return outcome.infeasible;
}

// qdd = -bmax qd, exact over the period: qd falls to exp(-bmax dt) of itself, whatever dt.
void Planner::Impl::brake(double dt_s, VectorXd& tau) const noexcept {
  const double dt = std::isfinite(dt_s) ? std::max(dt_s, kLeastPeriod_s) : 1e-3;
  tau.noalias() = arm.M * (std::expm1(-options.brake_rate * dt) / dt * arm.qd);
  tau += arm.coriolis;
}

// Full speed up to stale_slow_s, none at stale_brake_s.
double Planner::Impl::slow_down(const Input& in) const noexcept {
  const double age = in.obstacles.empty() && in.obstacle_age_s == scene::kInf ? 0.0 : in.obstacle_age_s;
  const double span = options.stale_brake_s - options.stale_slow_s;
  return span > 0 ? std::clamp(1 - (age - options.stale_slow_s) / span, 0.0, 1.0) : 1.0;
}

bool Planner::Impl::target_blocked() const noexcept {
  const bool turns = goal.kind != scene::GoalKind::pose;
  const double dmin = options.barrier_gain > 0 ? options.dmin_m : 0;
  const auto items = obstacles.items();
  return std::any_of(items.begin(), items.end(), [&](const Obstacles::Item& item) {
    return pairs.blocks(item, attraction.target(), turns, item.inflation_m + dmin);
  });
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
  out.kinetic_J = arm.q.allFinite() ? 0.5 * arm.qd.dot(arm.M.lazyProduct(arm.qd)) : 0;
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
  out.barrier_steps = outcome.steps;
  report_links(pairs, options, out);
}

}  // namespace hamel::planner
