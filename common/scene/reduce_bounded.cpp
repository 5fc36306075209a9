// The bounded part of reduce(): what changes results by no more than the scene's accuracy allows.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/scene/outward.h"
#include "common/scene/reduce.h"
#include "common/scene/reduction_notes.h"
#include "common/scene/rules.h"

namespace hamel::scene {
namespace {

constexpr double kLeastStreamHz = 30;   // a stream is resampled at least so often
constexpr double kSetsInStaleness = 3;  // so many sets come while one of them would still be fresh
constexpr double kSlowestCycle_s = 0.01;
// Seldomer cycles, as long as no point of the arm is faster than so many times what the end effector is drawn
// with: barrier, circulation and other links may be.
constexpr double kHurry = 1.5;
constexpr double kOvershoot =
    2;  // the bound goes by it: room for what the arm speeds up in one written period

Reduction& note_bounded(Scene& s, const std::string& name, bool on, const std::string& what,
                        const std::string& why) {
  Reduction& r = note(s, name, on, what, why);
  r.exact = false;
  r.bound_unit = std::string("m");
  return r;
}

/// What the standing obstacles come to; sets are put together as they arrive.
void note_merge(Scene& s) {
  const bool wish = wanted(s.reduce, s.reduce.merge, false);
  const std::vector<geometry::Obstacle> all = standing(s);
  std::vector<geometry::Obstacle> merged = all;
  Merge merge(s.accuracy.obstacle_error_m, s.planner.rho0_m);
  if (wish) merge.apply(Reach(s.robot, s.planner), 0, merged);
  const bool moving = s.perception.stream || all.size() < s.perception.obstacles.size();
  const bool on = wish && (moving || merged.size() < all.size());
  Reduction& r = note_bounded(
      s, "merge", on, count(all.size() - merged.size(), "standing obstacles that become part of others"),
      on     ? "capsules around them reach no farther than the bound; each set is looked at once"
      : wish ? "no capsules around some reach as little beyond them as asked"
             : unwanted(s.reduce.merge, " look for some"));
  sizes(r, static_cast<double>(all.size()), static_cast<double>(merged.size()), "obstacles");
  // Of what comes within rho0; farther off it grows in proportion.
  r.bound = on ? std::min(moving ? kInf : merge.excess_m(), s.accuracy.obstacle_error_m) : 0;
  r.live = on;
}

void note_requery(Scene& s) {
  const bool on = s.reduce.requery == Choice::on;
  Reduction& r = note_bounded(
      s, "requery", on, "links out of range asked for distances " + std::string(on ? "seldom" : "each cycle"),
      on ? std::string("they, and what moves, went no farther since; commands stay the same")
         : std::string("reduce { requery: on } would ask seldom; it bought nothing on the scenes measured"));
  r.bound = on ? s.accuracy.obstacle_error_m : 0;
  r.live = true;
}

/// The slowest rate at which no scripted obstacle, carried on from its last set, is off by more than asked.
double rate_needed_hz(const Scene& s) {
  double rate = kSetsInStaleness / s.planner.stale_slow_s;
  if (s.perception.stream) rate = std::max(rate, kLeastStreamHz);
  for (const ScriptedObstacle& o : s.perception.obstacles)
    rate = std::max(rate, std::sqrt(carried_error_m(o, 1) / s.accuracy.obstacle_error_m));
  return rate;
}

void reduce_rate(Scene& s) {
  const double before = s.perception.rate_hz, needed = rate_needed_hz(s);
  const bool less = needed < before, on = less && wanted(s.reduce, s.reduce.rate, false);
  if (on) s.perception.rate_hz = needed;
  Reduction& r =
      note_bounded(s, "rate", on, on ? "obstacle sets published less often" : "obstacle sets as written",
                   !less ? "the obstacles' motion, or their staleness, needs " + number(needed) + " Hz"
                   : on  ? "carried on with their velocities they stay within the bound"
                         : unwanted(s.reduce.rate));
  sizes(r, before, s.perception.rate_hz, "Hz");
  for (const ScriptedObstacle& o : s.perception.obstacles)
    r.bound = std::max(r.bound, on ? carried_error_m(o, 1 / s.perception.rate_hz) : 0);
}

/// The fastest of the scripted obstacles; +inf where a stream's are not known before it runs.
double fastest_obstacle_mps(const Scene& s) {
  double fastest = s.perception.stream ? kInf : 0;
  for (const ScriptedObstacle& o : s.perception.obstacles)
    fastest = std::max(fastest,
                       o.velocity_mps.norm() + 2 * std::numbers::pi * o.frequency_hz * o.amplitude_m.norm());
  return fastest;
}

/// A planner cycle is needed each time the arm at twice the greatest speed wanted of its end effector and the
/// fastest obstacle may have closed in by what a surface may be off; as often as written while a point of the
/// arm is nearly so fast.
void reduce_cycle(Scene& s) {
  const double closing_mps = kOvershoot * s.planner.vmax_mps + fastest_obstacle_mps(s);
  const double needed_s = std::min(s.accuracy.obstacle_error_m / closing_mps, kSlowestCycle_s);
  const int before = s.planner.period_steps;
  const int needed =
      before * static_cast<int>(std::floor(needed_s / (before * s.dynamics.dt_s) * (1 + 1e-9)));
  const bool less = needed > before, on = less && s.reduce.cycle == Choice::on;
  if (on) {
    s.planner.period_steps = needed;
    s.hurry.period_steps = before;
    s.hurry.mps = kHurry * s.planner.vmax_mps;
  }
  const std::string why =
      std::isinf(closing_mps) ? "no speed limits how fast the arm or an obstacle closes in"
      : !less                 ? "the arm's and the obstacles' speeds need one each " + number(needed_s) + " s"
      : on ? "nothing closes in by more than the bound between two; as often as written while a point of the "
             "arm is faster than " +
                 number(s.hurry.mps) + " m/s"
           : "reduce { cycle: on } would; fidelity: fastest chooses the planner's period with the step";
  Reduction& r =
      note_bounded(s, "cycle", on, on ? "planner cycles less often" : "planner cycles as written", why);
  sizes(r, 1 / (before * s.dynamics.dt_s), 1 / (s.planner.period_steps * s.dynamics.dt_s), "Hz");
  r.bound = on ? closing_mps * s.planner.period_steps * s.dynamics.dt_s : 0;
}

void note_step(Scene& s) {
  const bool on = wanted(s.reduce, s.reduce.step, false);
  Reduction& r = note_bounded(s, "step", false, "tier and step as written",
                              on ? "chosen by hamel run, up, batch or explain, and not yet"
                                 : unwanted(s.reduce.step, " choose them for the accuracy"));
  sizes(r, s.dynamics.dt_s, s.dynamics.dt_s, "s");
  r.bound_unit = std::string("rad");
  r.live = true;
}

}  // namespace

double carried_error_m(const ScriptedObstacle& o, double period_s) noexcept {
  const double turn = 2 * std::numbers::pi * o.frequency_hz;
  return 0.5 * turn * turn * o.amplitude_m.norm() * period_s * period_s;
}

void reduce_shapes(Scene& s) {
  if (!s.steered) return;
  const bool on = wanted(s.reduce, s.reduce.shapes, false);
  Robot simpler = s.robot;
  const double excess = simplify_shapes(simpler, s.accuracy.obstacle_error_m);
  const std::size_t before = s.robot.shapes.size(), after = simpler.shapes.size();
  if (on) s.robot = std::move(simpler);
  Reduction& r = note_bounded(s, "shapes", on && excess > 0,
                              count(before - after, "link shapes that become part of others"),
                              !on           ? unwanted(s.reduce.shapes)
                              : excess == 0 ? "no simpler ones reach as little beyond them as asked"
                                            : "capsules around them reach no farther than the bound");
  sizes(r, static_cast<double>(before), static_cast<double>(on ? after : before), "shapes");
  r.bound = on ? excess : 0;
  r.live = r.in_force;
}

void reduce_bounded(Scene& s) {
  if (s.steered) {
    note_merge(s);
    note_requery(s);
    reduce_rate(s);
    reduce_cycle(s);
  }
  note_step(s);
}

}  // namespace hamel::scene
