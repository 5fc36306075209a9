#include "clients/hamel/explain_cost.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/hamel/ticks.h"
#include "common/rbd/rbd.h"
#include "common/scene/reduce.h"
#include "services/perception/convert.h"
#include "services/planner/core/pairs.h"

namespace hamel::client {

namespace {

constexpr int kRounds = 5;            // of each variant, in turns; the fastest counts
constexpr std::uint64_t kLeast = 50;  // steps in a round, where the scene has so many

/// A variant of the scene under the watch.
struct Variant {
  scene::Scene scene;
  StepCost cost;
  std::vector<Eigen::VectorXd> q;  ///< after each step of the first round
};

/// What reading the clock takes [s]: it is part of every time between two readings.
double reading_s(const trade::Watch& watch) {
  constexpr int kReadings = 200;
  double least_s = scene::kInf;
  for (int round = 0; round < kRounds; ++round) {
    const double began = watch.now_s();
    for (int k = 1; k < kReadings; ++k) (void)watch.now_s();
    least_s = std::min(least_s, (watch.now_s() - began) / kReadings);
  }
  return least_s;
}

/// Runs `seconds` of the scene; the least cost of a round is kept.  Returns the steps made.
std::uint64_t round(Variant& v, double seconds, const trade::Watch& watch, double reading_s) {
  Ticks ticks(v.scene);
  const bool first = v.q.empty(), steered = v.scene.steered;
  const auto steps = std::max(kLeast, static_cast<std::uint64_t>(seconds / v.scene.dynamics.dt_s));
  double plan_s = 0;
  std::uint64_t k = 0;
  const double began = watch.now_s();
  for (; k < steps && !ticks.done(); ++k) {
    if (steered) {
      const double a = watch.now_s();
      ticks.plan();
      plan_s += watch.now_s() - a - reading_s;
    }
    if (!ticks.step()) break;
    if (first) v.q.push_back(ticks.arm().state().q);
  }
  if (k == 0) return 0;
  const double readings = steered ? 2 * static_cast<double>(k) + 1 : 1;
  const double step_s = watch.now_s() - began - readings * reading_s - plan_s;
  v.cost.planner_us = std::min(v.cost.planner_us, 1e6 * plan_s / static_cast<double>(k));
  v.cost.dynamics_us = std::min(v.cost.dynamics_us, 1e6 * step_s / static_cast<double>(k));
  return k;
}

/// How much of the scene's time fills `seconds` of ours [s].
double span_for(const scene::Scene& s, double seconds, const trade::Watch& watch, double reading_s) {
  Variant probe{s, {}, {}};
  const double began = watch.now_s();
  const std::uint64_t k = round(probe, 4 * kLeast * s.dynamics.dt_s, watch, reading_s);
  const double each = (watch.now_s() - began) / static_cast<double>(std::max<std::uint64_t>(k, 1));
  return std::max<double>(kLeast, seconds / kRounds / each) * s.dynamics.dt_s;
}

/// Largest distance of two paths at the times that both have; NaN of none.
double apart(const Variant& a, const Variant& b) {
  const double per = b.scene.dynamics.dt_s / a.scene.dynamics.dt_s;  // steps of a in one of b
  double worst = NAN;
  for (std::size_t k = 1; k <= b.q.size(); ++k) {
    const double at = static_cast<double>(k) * per, whole = std::round(at);
    if (std::abs(at - whole) > 1e-9 * at || whole < 1) continue;
    const auto i = static_cast<std::size_t>(whole);
    if (i > a.q.size() || a.q[i - 1].size() != b.q[k - 1].size()) break;
    worst = std::fmax(worst, (a.q[i - 1] - b.q[k - 1]).lpNorm<Eigen::Infinity>());
  }
  return worst;
}

/// None for those that are always done, or by nobody; and for the step, which is measured apart.
scene::Choice* choice(scene::ReduceOptions& o, const std::string& name) {
  for (const scene::NamedChoice& c : scene::choices())
    if (name == c.name && name != "step") return &(o.*c.choice);
  return nullptr;
}

Variant variant(scene::Scene s) {
  const double dt_s = s.dynamics.dt_s;
  return {std::move(s), {scene::kInf, scene::kInf, dt_s, 0}, {}};
}

scene::Scene reduced(scene::Scene s) {
  scene::reduce(s);
  return s;
}

/// The scene by the chosen tier and step, if any, on the plane or in space as it is.
scene::Scene chosen_too(scene::Scene s, const std::optional<Choosing>& choosing) {
  if (!choosing || !choosing->chosen) return s;
  scene::DynamicsOptions o = choosing->chosen->dynamics;
  o.space = s.dynamics.space;
  return with(s, o, choosing->chosen->period_steps);
}

ObstacleCount count_obstacles(const scene::Scene& s) {
  ObstacleCount out;
  const auto source = perception::Source::make(s.perception);
  if (!s.steered || !source) return out;
  const double period_s = source.value().period_s();
  planner::ObstacleView view(s);
  wire::ObstacleSet set;
  for (double t_s = 0; t_s <= s.duration_s; t_s = source.value().next_time(t_s)) {
    const auto k = static_cast<std::uint64_t>(std::llround(t_s / period_s));
    if (!perception::to_wire(source.value(), k, k, true, set)) continue;
    wire::Causes causes;
    view.add(set);
    (void)view.at(t_s, s.q0, causes);
    out.before = std::max(out.before, view.all().size());
    out.after = std::max(out.after, view.obstacles().size());
  }
  return out;
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
  Explained out{written, reduced(full), reduced(written), {}, {}, {}, {}, {}, {}};
  if (scene::wanted(written.reduce, written.reduce.step, false)) {
    out.choosing = choose(out.reduced, watch);
    apply(*out.choosing, out.reduced);
  }
  out.obstacles = count_obstacles(out.reduced);
  std::vector<Variant> variants{variant(out.full), variant(out.reduced)};
  for (const scene::Reduction& r : out.reduced.reductions) {
    scene::Scene s = written;
    scene::Choice* const c = choice(s.reduce, r.name);
    if (!r.in_force || (c == nullptr && r.name != "step")) continue;
    if (c != nullptr) *c = scene::Choice::off;
    s = reduced(std::move(s));
    variants.push_back(variant(c != nullptr ? chosen_too(std::move(s), out.choosing) : std::move(s)));
    out.each.push_back({r.name, {}});
  }
  const double reading = reading_s(watch), span_s = span_for(out.full, seconds, watch, reading);
  for (int k = 0; k < kRounds; ++k)
    for (Variant& v : variants) {
      watch.say("costs: round " + std::to_string(k + 1) + " of " + std::to_string(kRounds));
      round(v, span_s, watch, reading);
    }
  for (Variant& v : variants) v.cost.joint_error = apart(variants[0], v);
  out.full_cost = variants[0].cost;
  out.reduced_cost = variants[1].cost;
  for (std::size_t k = 0; k < out.each.size(); ++k) out.each[k].without = variants[k + 2].cost;
  const auto steps = static_cast<std::uint64_t>(4 * span_s / written.dynamics.dt_s);
  for (const scene::Reduction& r : out.reduced.reductions) {
    if (r.exact || !r.in_force || r.name == "step") continue;
    watch.say("error of " + r.name);
    const double near_m = r.name == "merge" ? written.planner.rho0_m : scene::kInf;
    const scene::Scene on = alone(written, r.name, true), off = alone(written, r.name, false);
    out.errors.push_back(
        {r.name, r.name == "cycle" ? closed_in(on, steps) : distance_error(on, off, steps, near_m)});
  }
  return out;
}

}  // namespace hamel::client
