#include "clients/hamel/choose.h"

#include <time.h>

#include <algorithm>
#include <cmath>

#include "clients/hamel/ticks.h"
#include "clients/hamel/trade_choice.h"
#include "common/base/text.h"
#include "common/rbd/planar_chain.h"

namespace hamel::client {

namespace {

using scene::Tier;
using trade::kSamples;

constexpr int kHalvings = 5;  // of a steered reference's step
constexpr double kShortRun_s = 0.05;

/// What an evaluation usually takes [us]: a fixed part and one for each joint, measured on one core; gauss
/// evaluates its stages side by side.
double evaluation_us(const scene::Scene& s, const scene::DynamicsOptions& o) {
  const bool flat = s.dynamics.space == scene::Space::automatic && rbd::is_planar(s.robot.chain);
  const double n = s.robot.chain.n();
  switch (o.tier) {
    case Tier::gauss:
      return (0.06 + (flat ? 0.045 : 0.08) * n) / o.stages;
    case Tier::rk4:
    case Tier::dopri8:
      return 0.02 + (flat ? 0.03 : 0.05) * n;
    default:
      return 0.02 + (flat ? 0.035 : 0.07) * n;
  }
}

/// What a planner cycle usually takes [us], with so many pairs of link and obstacle in range.
double cycle_us(const scene::Scene& s, double pairs) {
  const double n = s.robot.chain.n();
  const bool gyro = s.planner.method == scene::Method::gyro;
  return gyro ? 0.6 * n + 0.1 * n * n + 0.5 * pairs : 0.5 * n + 0.3 * pairs;
}

double horizon_of(const scene::Scene& s) {
  return s.accuracy.horizon_s > 0 ? std::min(s.accuracy.horizon_s, s.duration_s) : s.duration_s;
}

/// The horizon in whole steps an instant.
long long steps_an_instant(double horizon_s, double dt_s) {
  return std::max(1LL, std::llround(horizon_s / kSamples / dt_s));
}

struct Path {
  std::vector<Eigen::VectorXd> q;
  Setting setting;
  planner::State end = planner::State::idle;
  std::uint64_t contacts = 0;
};

/// One run over the horizon, past the goal.
Path follow(const scene::Scene& s, double horizon_s, const trade::Watch& watch) {
  Path path;
  path.setting = {.dynamics = s.dynamics, .period_steps = s.planner.period_steps};
  Ticks ticks(s);
  double evaluations = 0, pairs = 0, steps = 0;
  const auto per_instant = steps_an_instant(horizon_s, s.dynamics.dt_s);
  const double began = watch.now_s();
  for (int k = 0; k < kSamples; ++k) {
    for (long long i = 0; i < per_instant; ++i) {
      if (i % 256 == 0 && watch.stop()) return path;
      ticks.plan();
      if (!ticks.step() || ticks.arm().report().substeps > 1) return path;
      evaluations += ticks.arm().report().evaluations;
      pairs += ticks.report().pairs_in_range;
      ++steps;
    }
    path.q.push_back(ticks.arm().state().q);
  }
  const double t_s = ticks.arm().t_s();
  const double cycles = s.steered ? 1 / (s.planner.period_steps * s.dynamics.dt_s) : 0;
  path.setting.finished = true;
  path.setting.seconds_per_s = (watch.now_s() - began) / t_s;
  path.setting.work_per_s =
      evaluations / t_s * evaluation_us(s, s.dynamics) + cycles * cycle_us(s, pairs / steps);
  path.setting.energy_error = ticks.arm().energy_drift_rel();
  path.end = ticks.report().state;
  path.contacts = ticks.report().contacts;
  return path;
}

double apart(const std::vector<Eigen::VectorXd>& a, const std::vector<Eigen::VectorXd>& b) {
  double worst = a.size() == b.size() ? 0 : scene::kInf;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k)
    worst = std::max(worst, (a[k] - b[k]).lpNorm<Eigen::Infinity>());
  return worst;
}

Converged converge_steered(const scene::Scene& scene, const trade::Watch& watch) {
  scene::Scene s = scene;
  s.dynamics.tier = Tier::midpoint;
  s.dynamics.tolerance_Nm = 0;
  s.planner.period_steps = 1;
  Converged best;
  best.horizon_s = horizon_of(scene);
  best.uncertainty = scene::kInf;
  s.dynamics.dt_s = trade::fitting_step(scene.dynamics.dt_s, best.horizon_s);
  Path coarse = follow(s, best.horizon_s, watch);
  for (int k = 0; k < kHalvings && !watch.stop(); ++k) {
    s.dynamics.dt_s /= 2;
    watch.say("reference: midpoint and planner each " + text(s.dynamics.dt_s) + " s");
    Path fine = follow(s, best.horizon_s, watch);
    const double off = apart(coarse.q, fine.q);
    const bool better = fine.setting.finished && off < best.uncertainty;
    if (better) best = {fine.q, best.horizon_s, off, s.dynamics.dt_s, fine.end, fine.contacts};
    if (best.uncertainty < 0.05 * scene.accuracy.joint_error_rad) break;
    coarse = std::move(fine);
  }
  return best;
}

Converged converge_free(const scene::Scene& s, const trade::Watch& watch) {
  const trade::Motion motion{
      .chain = s.robot.chain, .q0 = s.q0, .qd0 = s.qd0, .horizon_s = horizon_of(s), .base = s.dynamics};
  trade::Reference r = trade::converge(motion, watch);
  const bool whole = r.valid_s >= motion.horizon_s * (1 - 1e-9);
  return {std::move(r.q), motion.horizon_s, whole ? r.uncertainty : scene::kInf, r.dt_s};
}

/// A way to run a scene.
struct Candidate {
  scene::DynamicsOptions dynamics;
  int period_steps = 1;
};

/// Of a free motion all that `hamel trade` measures.  Else tiers and steps worth a try, a planner cycle each
/// step; steps as short as written, cycles seldomer.
std::vector<Candidate> candidates(const scene::Scene& s) {
  const double horizon_s = horizon_of(s);
  std::vector<Candidate> out;
  if (!s.steered) {
    const trade::Motion motion{
        .chain = s.robot.chain, .q0 = s.q0, .qd0 = s.qd0, .horizon_s = horizon_s, .base = s.dynamics};
    for (const scene::DynamicsOptions& o : trade::candidates(motion, false)) out.push_back({o, 1});
    return out;
  }
  const auto add = [&](Tier tier, double times, int period_steps) {
    scene::DynamicsOptions o = s.dynamics;
    o.tier = tier;
    o.tolerance_Nm = 0;
    o.dt_s = trade::fitting_step(times * s.dynamics.dt_s, horizon_s);
    out.push_back({o, period_steps});
  };
  for (const Tier tier : {Tier::midpoint, Tier::semi_implicit_euler, Tier::rk4})
    for (const double times : {0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 10.0, 16.0, 20.0})
      add(tier, times, 1);
  for (const Tier tier : {Tier::midpoint, Tier::semi_implicit_euler})
    for (const int period : {2, 3, 4, 5, 8}) add(tier, 1, period);
  return out;
}

}  // namespace

trade::Watch steady_watch() {
  return {[] {
            timespec t{};
            clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
            return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
          },
          [] { return false; }};
}

scene::Scene with(const scene::Scene& s, const scene::DynamicsOptions& o, int period_steps) {
  scene::Scene out = s;
  out.dynamics = o;
  out.planner.period_steps = period_steps;
  out.hurry = {};
  return out;
}

Converged converge(const scene::Scene& s, const trade::Watch& watch) {
  return s.steered ? converge_steered(s, watch) : converge_free(s, watch);
}

Setting measure(const scene::Scene& s, const Converged& reference, const trade::Watch& watch) {
  Path path = follow(s, reference.horizon_s, watch);
  for (int k = 0;
       k < 2 && path.setting.finished && path.setting.seconds_per_s * reference.horizon_s < kShortRun_s; ++k)
    path.setting.seconds_per_s =
        std::min(path.setting.seconds_per_s, follow(s, reference.horizon_s, watch).setting.seconds_per_s);
  path.setting.joint_error = apart(path.q, reference.q);
  path.setting.same_end =
      !s.steered || (path.end == reference.end && (path.contacts == 0 || reference.contacts > 0));
  return path.setting;
}

double error_bound(const Setting& s, const Converged& reference) noexcept {
  return trade::error_bound(s.joint_error, reference.uncertainty);
}

bool meets(const scene::Accuracy& asked, const Setting& s, const Converged& reference) noexcept {
  return s.finished && s.same_end && error_bound(s, reference) <= asked.joint_error_rad &&
         s.energy_error <= asked.energy_error_rel;
}

Choosing choose(const scene::Scene& s, const trade::Watch& watch) {
  Choosing out;
  out.reference = converge(s, watch);
  if (!trade::judges(out.reference.uncertainty, s.accuracy.joint_error_rad)) return out;
  const std::vector<Candidate> all = candidates(s);
  for (const Candidate& c : all) {
    if (watch.stop()) return out;
    watch.say("tier and step: " + std::to_string(out.tried.size()) + " of " + std::to_string(all.size()) +
              " tried, " + trade::label(c.dynamics) + " dt " + text(c.dynamics.dt_s) + " s");
    out.tried.push_back(measure(with(s, c.dynamics, c.period_steps), out.reference, watch));
    const Setting& now = out.tried.back();
    if (meets(s.accuracy, now, out.reference) && (!out.chosen || now.work_per_s < out.chosen->work_per_s))
      out.chosen = now;
  }
  return out;
}

void apply(const Choosing& c, scene::Scene& s) {
  if (!c.chosen) {
    for (scene::Reduction& r : s.reductions)
      if (r.name == "step") r.why = "nothing tried keeps to the accuracy";
    return;
  }
  const Setting& setting = *c.chosen;
  for (scene::Reduction& r : s.reductions) {
    if (r.name == "cycle" && r.in_force) {
      r.in_force = false;
      r.why = "the step was chosen, and the planner's period with it";
      r.after = 1 / (setting.period_steps * setting.dynamics.dt_s);
    }
    if (r.name != "step") continue;
    r.in_force = true;
    r.what = trade::label(setting.dynamics);
    if (s.steered)
      r.what += ", a planner cycle each " + text(setting.period_steps * setting.dynamics.dt_s) + " s";
    r.why = "measured against the converged motion, the cheapest that keeps to the accuracy";
    r.after = setting.dynamics.dt_s;
    r.bound = error_bound(setting, c.reference);
  }
  s = with(s, setting.dynamics, setting.period_steps);
}

std::vector<std::string> overrides(const Setting& s) {
  const scene::DynamicsOptions& o = s.dynamics;
  std::vector<std::string> out{std::string("dynamics.tier=") + scene::to_string(o.tier),
                               "dynamics.dt_s=" + text(o.dt_s),
                               std::string("dynamics.root=") + scene::to_string(o.root),
                               "dynamics.tolerance_Nm=" + text(o.tolerance_Nm),
                               "dynamics.tolerance_rel=" + text(o.tolerance_rel),
                               "dynamics.stages=" + text(o.stages),
                               "planner.period_steps=" + text(s.period_steps)};
  return out;
}

}  // namespace hamel::client
