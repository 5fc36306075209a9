#pragma once
/// Scenes and runs for the planner's tests: planner core and integrator in one loop, nothing between them.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "common/scene/scene.h"
#include "services/dynamics/core/integrator.h"
#include "services/planner/core/escape.h"
#include "services/planner/core/planner.h"
#include "tests/support/chains.h"

namespace hamel::test {

inline geometry::Obstacle sphere(std::uint32_t id, const Eigen::Vector3d& centre, double radius,
                                 const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero()) {
  geometry::Obstacle o;
  o.id = id;
  o.shape = {geometry::ShapeKind::sphere, {radius, 0, 0}};
  o.X_WO.p = centre;
  o.V_WO.tail<3>() = velocity;
  return o;
}

/// A capsule from a to b in a link's frame.
inline scene::LinkShape link_capsule(int link, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                     double radius) {
  scene::LinkShape s;
  s.link = link;
  s.shape = {geometry::ShapeKind::capsule, {radius, (b - a).norm(), 0}};
  s.X_LS.p = 0.5 * (a + b);
  s.X_LS.R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), b - a).toRotationMatrix();
  return s;
}

/// n planar links of 1 m and 1 kg in the x-y plane, no gravity, each a capsule of `radius`.
inline scene::Robot planar_arm(int n, double inertia_kgm2, double radius) {
  model::ChainSpec spec = planar(n, 1.0, 1.0, inertia_kgm2);
  spec.gravity_W_mps2.setZero();
  scene::Robot robot{"planar", "", checked(std::move(spec)), {}};
  for (int i = 0; i < n; ++i) robot.shapes.push_back(link_capsule(i, {0, 0, 0}, {1, 0, 0}, radius));
  return robot;
}

/// Example 5.2, set s1: everything agreements.md says about it.
struct Example52 {
  scene::Robot robot = planar_arm(4, 1.0, 0.0);
  std::vector<geometry::Obstacle> obstacles{sphere(1, {2.4, 2.2, 0}, 0.25)};
  scene::PlannerOptions options;
  scene::Goal goal;
  Eigen::VectorXd q0 = Eigen::VectorXd::Zero(4);

  Example52() {
    options.method = scene::Method::gyro_paper;
    options.gain_form = scene::GainForm::F2;
    options.mapping = scene::Mapping::paper;
    options.pairs = scene::PairPolicy::nearest;
    options.relative_velocity = false;
    options.kp = 25;
    options.kv = 20;
    options.damping = 2;
    options.kobs = 4;
    options.rho0_m = 0.5;
    options.lambda2 = 1e-3;
    options.lambda2_relative = false;
    goal.id = 1;
    goal.X_WG.p = {2, 3, 0};
  }
};

struct RunResult {
  planner::Report last;
  double final_error_m = 0, reached_at_s = -1, contact_at_s = -1, stuck_at_s = -1;
  double clearance_min_m = std::numeric_limits<double>::infinity();
  planner::Reason stuck_reason = planner::Reason::none;
  int infeasible_cycles = 0;
  double gyro_work_J = 0, variation_radps3 = 0;  ///< variation: mean |change of qdd| a second
  int escapes = 0;                               ///< waypoints taken
  Eigen::VectorXd q, qd;
};

/// Runs planner and midpoint integrator for duration_s, on past REACHED and STUCK.  Spheres move with their
/// velocity.  A planner that asks for an escape is answered, after its delay.
inline RunResult run(const scene::Robot& robot, std::vector<geometry::Obstacle> obstacles,
                     const scene::PlannerOptions& options, const scene::Goal& goal, const Eigen::VectorXd& q0,
                     double dt_s, double duration_s, const std::function<bool(const RunResult&)>& stop = {}) {
  planner::Planner planner(robot, options);
  planner.set_goal(goal);
  scene::DynamicsOptions dynamics_options;
  dynamics_options.dt_s = dt_s;
  dynamics::Integrator dynamics(robot.chain, dynamics_options);
  dynamics::State state = dynamics.start(q0, Eigen::VectorXd::Zero(q0.size()));
  planner::Output out = planner.output();
  RunResult r;
  planner::Escape escape;
  std::uint64_t escape_due = 0;
  Eigen::VectorXd qd_before = state.qd, qdd_before = state.qd;
  const auto steps = static_cast<std::uint64_t>(std::llround(duration_s / dt_s));
  for (std::uint64_t k = 0; k <= steps; ++k) {
    const double t = static_cast<double>(k) * dt_s;
    const planner::Input in{
        .step = k, .t_s = t, .dt_s = dt_s, .q = state.q, .qd = state.qd, .obstacles = obstacles};
    if (escape_due > 0 && k >= escape_due) {
      planner.take_escape(escape.waypoint, t);
      r.escapes += escape.found;
      escape_due = 0;
    }
    planner.plan(in, out);
    if (out.report.escape_asked) {
      escape = planner::find_escape(robot, options, planner.escape_question(in));
      escape_due = k + planner.escape_steps(dt_s);
    }
    r.last = out.report;
    r.clearance_min_m = out.report.clearance_min_m;
    r.gyro_work_J += out.report.gyroscopic_power_W * dt_s;
    if (r.contact_at_s < 0 && out.report.contacts > 0) r.contact_at_s = t;
    if (out.report.time_to_goal_s >= 0) r.reached_at_s = out.report.time_to_goal_s;
    if (out.report.reason == planner::Reason::infeasible) ++r.infeasible_cycles;
    if (out.report.state == planner::State::stuck && r.stuck_at_s < 0) {
      r.stuck_at_s = t;
      r.stuck_reason = out.report.reason;
    }
    if (k == steps || (stop && stop(r))) break;
    if (!dynamics.step(state, out.torque_Nm).usable()) {
      ADD_FAILURE() << "the integrator gave up at " << t << " s";
      break;
    }
    const Eigen::VectorXd qdd = (state.qd - qd_before) / dt_s;
    if (k > 0) r.variation_radps3 += (qdd - qdd_before).lpNorm<1>() / duration_s;
    qd_before = state.qd;
    qdd_before = qdd;
    for (geometry::Obstacle& o : obstacles) o.X_WO.p += dt_s * o.V_WO.tail<3>();
  }
  r.final_error_m = r.last.target_error_m;
  r.q = state.q;
  r.qd = state.qd;
  return r;
}

}  // namespace hamel::test
