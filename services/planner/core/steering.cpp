// The torque of a cycle: attraction, damping, forces of the obstacles, and the barrier over all.
#include <algorithm>
#include <cmath>

#include "services/planner/core/force_law.h"
#include "services/planner/core/holds.h"
#include "services/planner/core/planner_impl.h"

namespace hamel::planner {

using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::Method;

namespace {

constexpr double kLastBrake = 15;  // what braking ends with [rad/s^2 or m/s^2]
constexpr double kFade_s = 0.5;    // circulation comes back over it after the barrier was infeasible

}  // namespace

// Brings arm and pairs to where the forces are evaluated.  The torque holds for a whole period, so `gyro`
// takes the middle of it: at dt 1 ms its barrier then keeps 96 % of dmin in example 5.2 instead of 87 %, at
// 10 ms 91 instead of 53 %.  The paper's methods take its beginning, as published.
void Planner::Impl::prepare(const Input& in) noexcept {
  const bool ahead = options.method == Method::gyro && in.dt_s > 0 && std::isfinite(in.dt_s);
  if (ahead) {
    qdd = q_now + 0.5 * in.dt_s * in.qd;
    arm.update(qdd, in.qd);
    pairs.advance(arm, 0.5 * in.dt_s);
  } else {
    arm.update(q_now, in.qd);
  }
  pairs.complete(arm);
}

// tau = attraction - bj M qd + forces of the obstacles.
void Planner::Impl::steer(const Input& in, bool refused, VectorXd& tau) noexcept {
  if (has_goal && !refused) tau_att = attraction.torque();
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
  qdd_rest = pull_share * attraction.drive();
  tau = tau_att - options.damping * arm.momentum;
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
  const double taken_W =
      options.damping * arm.qd.dot(arm.momentum) + pull_share * std::max(attraction.braking_W(), 0.0);
  memory.tank_J = std::clamp(memory.tank_J + dt_s * taken_W, 0.0, memory.tank_full_J);
  return memory.tank_full_J > 0 ? smooth_step(10 * memory.tank_J / memory.tank_full_J) : 0;
}

// Held-direction circulation with its flip timer; 1.8.
void Planner::Impl::circulate(const Input& in, VectorXd& tau) noexcept {
  const double t_s = in.t_s;
  if (!(options.kc > 0) || !has_goal) return;
  const double fade = std::clamp((t_s - memory.infeasible_s) / kFade_s, 0.0, 1.0);
  const double kc = near_enough() ? 0 : fade * open_tank(in.dt_s) * options.kc;
  const bool pressed = gyro.add_circulation(pairs, memory, t_s, kc, qdd_att, qdd_rest, tau);
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
    if (memory.flips < kFlips) memory.progress_s = t_s;  // the other side gets its own window
  }
}

// The barrier over the wanted torque; true where it had to give up and brakes.
bool Planner::Impl::guard(const Input& in, VectorXd& tau) noexcept {
  if (!(options.barrier_gain > 0)) return false;
  qdd = tau - arm.coriolis;
  arm.M_llt.solveInPlace(qdd);
  outcome = barrier.solve(arm, pairs, in.dt_s, qdd);
  if (outcome.infeasible) {
    qdd = braking_rate(in.dt_s) * arm.qd;
    (void)barrier.solve(arm, pairs, in.dt_s, qdd);
  }
  if (outcome.active || outcome.infeasible) tau.noalias() = arm.coriolis + arm.M * qdd;
  return outcome.infeasible;
}

// qdd = -(bmax + a/s) qd with s the speed of the fastest joint: s falls as sdot = -bmax s - a and is 0 after
// a while, where -bmax s alone would creep.  Exact over the period, whatever dt:
//   s(dt) = max(0, (s + a/bmax) exp(-bmax dt) - a/bmax).
double Planner::Impl::braking_rate(double dt_s) const noexcept {
  const double dt = std::isfinite(dt_s) ? std::max(dt_s, kLeastPeriod_s) : 1e-3;
  const double s = std::max(arm.qd.lpNorm<Eigen::Infinity>(), 1e-9);
  const double lost = std::expm1(-options.brake_rate * dt) * (1 + kLastBrake / (options.brake_rate * s));
  return std::max(lost, -1.0) / dt;
}

// As hard as the joints are strong.  What stands about the arm plays no part: it may be old, or wrong.
void Planner::Impl::brake(double dt_s, VectorXd& tau) noexcept {
  qdd = braking_rate(dt_s) * arm.qd;
  barrier.keep_torque(arm, qdd);
  tau.noalias() = arm.M * qdd;
  tau += arm.coriolis;
}

}  // namespace hamel::planner
