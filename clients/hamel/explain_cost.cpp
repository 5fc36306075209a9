#include "clients/hamel/explain_cost.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/hamel/ticks.h"
#include "common/rbd/rbd.h"
#include "common/scene/reduce.h"
#include "services/planner/core/pairs.h"

namespace hamel::client {

namespace {

constexpr int kRounds = 5;            // of each variant, in turns; the fastest counts
constexpr std::uint64_t kLeast = 50;  // steps in a round

/// A variant of the scene under the watch.
struct Variant {
  scene::Scene scene;
  StepCost cost{scene::kInf, scene::kInf, 0};
  std::vector<Eigen::VectorXd> q;  ///< after each step of the first round
};

/// Runs up to `steps` steps; true while the cost of each round is the least so far kept.
std::uint64_t round(Variant& v, std::uint64_t steps, const trade::Watch& watch) {
  Ticks ticks(v.scene);
  const bool first = v.q.empty();
  double plan_s = 0, step_s = 0;
  std::uint64_t k = 0;
  for (; k < steps && !ticks.done(); ++k) {
    const double a = watch.now_s();
    ticks.plan();
    const double b = watch.now_s();
    if (!ticks.step()) break;
    const double c = watch.now_s();
    plan_s += b - a;
    step_s += c - b;
    if (first) v.q.push_back(ticks.arm().state().q);
  }
  if (k == 0) return 0;
  if (!v.scene.steered) plan_s = 0;
  v.cost.planner_us = std::min(v.cost.planner_us, 1e6 * plan_s / static_cast<double>(k));
  v.cost.dynamics_us = std::min(v.cost.dynamics_us, 1e6 * step_s / static_cast<double>(k));
  return k;
}

/// How many steps fill `seconds`.
std::uint64_t steps_for(const scene::Scene& s, double seconds, const trade::Watch& watch) {
  Variant probe{s, {}, {}};
  const double began = watch.now_s();
  const std::uint64_t k = round(probe, 4 * kLeast, watch);
  const double each = (watch.now_s() - began) / static_cast<double>(std::max<std::uint64_t>(k, 1));
  return std::max(kLeast, static_cast<std::uint64_t>(seconds / kRounds / each));
}

/// Largest distance of two paths whose arms have the same joints.
double apart(const Variant& a, const Variant& b) {
  double worst = 0;
  for (std::size_t k = 0; k < std::min(a.q.size(), b.q.size()); ++k)
    if (a.q[k].size() == b.q[k].size()) worst = std::max(worst, (a.q[k] - b.q[k]).lpNorm<Eigen::Infinity>());
  return worst;
}

/// None for those that are always done, or by nobody; and for the step, which is measured apart.
scene::Choice* choice(scene::ReduceOptions& o, const std::string& name) {
  for (const scene::NamedChoice& c : scene::choices())
    if (name == c.name && name != "step") return &(o.*c.choice);
  return nullptr;
}

Variant reduced(scene::Scene s) {
  scene::reduce(s);
  return {std::move(s), {scene::kInf, scene::kInf, 0}, {}};
}

/// The exact reductions, with or without this bounded one.
scene::Scene alone(const scene::Scene& written, const std::string& name, bool with) {
  scene::Scene s = written;
  s.reduce = {};
  *choice(s.reduce, name) = with ? scene::Choice::on : scene::Choice::off;
  scene::reduce(s);
  return s;
}

/// The longest way of a point of the arm between two configurations, at most: of a capsule the farther of its
/// ends, and what its radius adds by turning, |R2 - R1| = |R2 - R1|_F / sqrt(2).
double farthest_way(const scene::Robot& robot, const rbd::Workspace& from, const rbd::Workspace& to) {
  const model::Chain& chain = robot.chain;
  double most = (rbd::tip(chain, to).p - rbd::tip(chain, from).p).norm();
  for (const scene::LinkShape& s : robot.shapes) {
    if (s.link < 0) continue;
    const auto i = static_cast<std::size_t>(s.link);
    const lie::Pose &a = from.X_WB[i], &b = to.X_WB[i];
    const geometry::Capsule c = s.X_LS * geometry::enclosing_capsule(s.shape);
    const double ends = std::max((b * c.p0 - a * c.p0).norm(), (b * c.p1 - a * c.p1).norm());
    most = std::max(most, ends + (b.R - a.R).norm() / std::numbers::sqrt2 * c.radius_m);
  }
  return most;
}

}  // namespace

double closed_in(const scene::Scene& s, std::uint64_t steps) {
  Ticks ticks(s);
  const model::Chain& chain = s.robot.chain;
  double obstacle_mps = 0;
  for (const scene::ScriptedObstacle& o : s.perception.obstacles)
    obstacle_mps = std::max(
        obstacle_mps, o.velocity_mps.norm() + 2 * std::numbers::pi * o.frequency_hz * o.amplitude_m.norm());
  const auto written = static_cast<std::uint64_t>(s.hurry.period_steps);
  rbd::Workspace before(chain), now(chain);
  std::uint64_t cycles = 0, last = 0;
  double most = 0;
  for (std::uint64_t k = 0; k < steps && !ticks.done(); ++k) {
    ticks.plan();
    if (ticks.cycles() > cycles) {
      rbd::positions(chain, ticks.arm().state().q, now);
      const double apart_s = static_cast<double>(k - last) * s.dynamics.dt_s;
      if (cycles > 0 && k - last > written)
        most = std::max(most, farthest_way(s.robot, before, now) + obstacle_mps * apart_s);
      std::swap(before, now);
      cycles = ticks.cycles();
      last = k;
    }
    if (!ticks.step()) break;
  }
  return most;
}

double distance_error(const scene::Scene& reduced, const scene::Scene& exact, std::uint64_t steps,
                      double near_m) {
  Ticks a(reduced), b(exact);
  double worst = 0;
  for (std::uint64_t k = 0; k < steps && !a.done(); ++k) {
    a.plan();
    b.plan(a.arm().state(), a.arm().t_s());
    const auto &x = a.report().links, &y = b.report().links;
    for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
      const double now_m = std::clamp(x[i].distance_m, 0.0, planner::kSeen_m),
                   true_m = std::clamp(y[i].distance_m, 0.0, planner::kSeen_m);
      worst = std::max(worst, std::abs(now_m - true_m) / std::max(1.0, true_m / near_m));
    }
    if (!a.step()) break;
  }
  return worst;
}

Explained explain_scene(const scene::Scene& written, double seconds, const trade::Watch& watch) {
  scene::Scene full = written;
  full.reduce = {};
  full.reduce.fidelity = scene::Fidelity::full;
  std::vector<Variant> variants{reduced(full), reduced(written)};
  Explained out{written, variants[0].scene, variants[1].scene, {}, {}, {}, {}, {}};
  for (const scene::Reduction& r : out.reduced.reductions) {
    scene::Scene s = written;
    scene::Choice* const c = choice(s.reduce, r.name);
    if (!r.in_force || c == nullptr) continue;
    *c = scene::Choice::off;
    variants.push_back(reduced(std::move(s)));
    out.each.push_back({r.name, {}});
  }
  const std::uint64_t steps = steps_for(variants[0].scene, seconds, watch);
  for (int k = 0; k < kRounds; ++k)
    for (Variant& v : variants) round(v, steps, watch);
  for (Variant& v : variants) v.cost.joint_error = apart(v, variants[0]);
  out.full_cost = variants[0].cost;
  out.reduced_cost = variants[1].cost;
  for (std::size_t k = 0; k < out.each.size(); ++k) out.each[k].without = variants[k + 2].cost;
  for (const scene::Reduction& r : out.reduced.reductions)
    if (!r.exact && r.in_force && r.name == "cycle")
      out.errors.push_back({r.name, closed_in(alone(written, r.name, true), 4 * steps)});
    else if (!r.exact && r.in_force)
      out.errors.push_back(
          {r.name, distance_error(alone(written, r.name, true), alone(written, r.name, false), 4 * steps,
                                  r.name == "merge" ? written.planner.rho0_m : scene::kInf)});
  if (scene::wanted(written.reduce, written.reduce.step, false)) {
    out.choosing = choose(out.reduced, watch);
    apply(*out.choosing, out.reduced);
  }
  return out;
}

}  // namespace hamel::client
