#include "common/scene/reduce.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/rbd/planar_chain.h"
#include "common/scene/locked.h"
#include "common/scene/reach.h"
#include "common/scene/reduction_notes.h"

namespace hamel::scene {
namespace {

using Options = ReduceOptions;
constexpr NamedChoice kChoices[] = {
    {"locked", &Options::locked}, {"plane", &Options::plane},   {"gravity", &Options::gravity},
    {"self", &Options::self},     {"shapes", &Options::shapes}, {"obstacles", &Options::obstacles},
    {"links", &Options::links},   {"merge", &Options::merge},   {"requery", &Options::requery},
    {"rate", &Options::rate},     {"cycle", &Options::cycle},   {"step", &Options::step}};

constexpr double kParallel = 1e-12;  // gravity that is off an axis by less is along it

void reduce_fixed(Scene& s) {
  const int n = s.robot.chain.n(), k = s.robot.fixed_joints;
  sizes(note(s, "fixed", k > 0, count(static_cast<std::size_t>(k), "fixed joints lumped"),
             k > 0 ? "links behind a fixed joint move as one; always done" : "the robot has none"),
        n + k, n, "joints");
}

void reduce_locked(Scene& s) {
  const auto at = locked_values(s);
  const auto k = static_cast<std::size_t>(
      std::count_if(at.begin(), at.end(), [](const auto& v) { return v.has_value(); }));
  const int n = s.robot.chain.n();
  const bool on = wanted(s.reduce, s.reduce.locked, true);
  if (k > 0 && on) freeze(s, at);
  if (k > 0 && !on) hold(s, at);
  const std::string why = k == 0 ? "no joint is locked"
                          : on   ? "their links move as one with what carries them"
                                 : "kept, and held by a huge rotor inertia";
  sizes(note(s, "locked", k > 0 && on, count(k, on ? "locked joints frozen" : "locked joints kept"), why), n,
        s.robot.chain.n(), "joints");
  s.locked.clear();
}

void reduce_plane(Scene& s) {
  const bool planar = rbd::is_planar(s.robot.chain);
  const bool wish = wanted(s.reduce, s.reduce.plane, true), spatial = s.dynamics.space == Space::se3;
  const bool on = planar && wish && !spatial;
  if (planar && !on) s.dynamics.space = Space::se3;
  const std::string why = !planar ? "revolute axes are not all parallel, or a slide is not across them"
                          : on    ? "all revolute axes parallel, all slides across them"
                          : wish  ? "dynamics.space is se3"
                                  : "forbidden";
  sizes(note(s, "plane", on, on ? "SE(2) in place of SE(3)" : "SE(3)", why), 6, on ? 3 : 6,
        "numbers in a twist");
}

/// True where the weight is parallel to every axis that turns and across every one that slides, whatever q:
/// turning about the weight leaves the angle of any other axis to it as it is.
bool weight_rests(const model::Chain& chain) {
  const Eigen::Vector3d g = chain.gravity_W_mps2();
  lie::Pose X_WB = chain.X_WB0();
  for (int i = 0; i < chain.n(); ++i) {
    const model::Joint& joint = chain.joint(i);
    X_WB = X_WB * joint.X_PJ;
    const Eigen::Vector3d axis_W = X_WB.R * joint.axis;
    const bool slides = joint.kind == model::JointKind::prismatic;
    const double across = slides ? std::abs(axis_W.dot(g)) : axis_W.cross(g).norm();
    if (across > kParallel * g.norm()) return false;
  }
  return true;
}

void reduce_gravity(Scene& s) {
  const Eigen::Vector3d g = s.robot.chain.gravity_W_mps2();
  const bool none = g.isZero(0), rests = !none && weight_rests(s.robot.chain);
  const bool on = rests && wanted(s.reduce, s.reduce.gravity, true);
  if (on) {
    model::ChainSpec spec = s.robot.chain.spec();
    spec.gravity_W_mps2.setZero();
    s.robot.chain = model::build(std::move(spec)).value();
  }
  const std::string why = none     ? "the scene has none"
                          : !rests ? "it works on a joint"
                          : on     ? "along every axis that turns, across every one that slides"
                                   : "forbidden";
  sizes(note(s, "gravity", on,
             on     ? "gravity dropped"
             : none ? "no gravity"
                    : "gravity kept",
             why),
        g.norm(), s.robot.chain.gravity_W_mps2().norm(), "m/s^2");
}

void note_terms(Scene& s) {
  std::size_t still = 0;
  for (int i = 0; i < s.robot.chain.n(); ++i) {
    const model::Joint& joint = s.robot.chain.joint(i);
    still += joint.damping == 0;
    still += joint.armature == 0;
  }
  const bool none = s.dynamics.stop_stiffness == 0;
  note(s, "terms", none, none ? "no stop torques evaluated" : "stop torques evaluated",
       count(still, "zero dampings and rotor inertias stay, a product and a sum each, no branch"));
}

void note_self(Scene& s) {
  if (!s.steered) return;
  const std::size_t pairs = s.robot.self_pairs.size();
  const bool on = wanted(s.reduce, s.reduce.self, true);
  Reduction& r = note(s, "self", on && pairs > 0, count(pairs, "pairs of link shapes that must not touch"),
                      pairs == 0 ? "none is watched"
                      : on       ? "those far apart are passed over until the links may have come near"
                                 : "forbidden");
  r.live = true;
}

/// One evaluation for dynamics and planner of one process: it cannot pay, which services/README.md shows.
void note_shared(Scene& s) {
  if (!s.steered) return;
  note(s, "shared", false, "no evaluation shared between services",
       "poses and velocities at q are all they have in common, 4 % of a cycle of a 7-joint arm; they meet on "
       "the bus alone");
}

void note_obstacles(Scene& s) {
  if (!s.steered) return;
  Reach reach(s.robot, s.planner);
  const std::vector<geometry::Obstacle> all = standing(s);
  std::vector<geometry::Obstacle> kept;
  std::vector<double> floor_m;
  reach.sift(all, 0, kept, floor_m);
  const bool moving = s.perception.stream || all.size() < s.perception.obstacles.size();
  const bool cull = wanted(s.reduce, s.reduce.obstacles, true);
  const std::string rest = moving ? "; moving ones are looked at in each set" : "";
  if (!cull) kept = all;
  Reduction& culled =
      note(s, "obstacles", cull, count(all.size() - kept.size(), "standing obstacles culled") + rest,
           cull ? "out of reach of every force, and never the nearest to a link; each set is sifted once"
                : "forbidden");
  sizes(culled, static_cast<double>(all.size()), static_cast<double>(kept.size()), "obstacles");
  culled.live = true;
  const bool skip = wanted(s.reduce, s.reduce.links, false);
  const auto far = static_cast<std::size_t>(std::count_if(
      floor_m.begin(), floor_m.end(), [&](double f) { return f > s.planner.rho0_m && std::isfinite(f); }));
  const int n = s.robot.chain.n();
  sizes(note(s, "links", skip && far > 0,
             count(skip ? far : 0, "links not asked for distances while others are nearer"),
             !skip ? unwanted(s.reduce.links, "; commands stay the same, but their report shows no distance")
             : far > 0 ? "no standing obstacle comes within rho0 of them; their report shows none"
                       : "standing obstacles may come within rho0 of every link, or there are none"),
        n, n - static_cast<int>(skip ? far : 0), "links");
}

}  // namespace

bool wanted(const ReduceOptions& o, Choice choice, bool exact) noexcept {
  if (choice != Choice::automatic) return choice == Choice::on;
  return exact ? o.fidelity != Fidelity::full : o.fidelity == Fidelity::fastest;
}

std::vector<geometry::Obstacle> standing(const Scene& s) {
  std::vector<geometry::Obstacle> out;
  for (const ScriptedObstacle& o : s.perception.obstacles)
    if (o.velocity_mps.isZero(0) && o.amplitude_m.isZero(0)) out.push_back(o.at_start);
  return out;
}

void reduce(Scene& s) {
  if (!s.reductions.empty()) return;
  reduce_fixed(s);
  reduce_locked(s);
  reduce_plane(s);
  reduce_gravity(s);
  note_terms(s);
  note_self(s);
  reduce_shapes(s);
  note_obstacles(s);
  reduce_bounded(s);
  note_shared(s);
}

std::span<const NamedChoice> choices() noexcept { return kChoices; }

std::vector<std::string> refused(const Scene& s) {
  std::vector<std::string> out;
  for (const NamedChoice& c : kChoices) {
    // Of all that `fastest` looks for, tier and step alone are a promise: the scene's accuracy.
    const bool promised = c.choice == &Options::step && wanted(s.reduce, s.reduce.step, false);
    if (s.reductions.empty() || (s.reduce.*c.choice != Choice::on && !promised)) continue;
    const auto r = std::find_if(s.reductions.begin(), s.reductions.end(),
                                [&](const Reduction& x) { return x.name == c.name; });
    if (r == s.reductions.end())
      out.push_back(std::string(c.name) + ": the scene is not steered");
    else if (!r->in_force)
      out.push_back(std::string(c.name) + ": " + r->why);
  }
  return out;
}

std::string names_in_force(const Scene& s) {
  std::string out;
  for (const Reduction& r : s.reductions) {
    const bool did = r.in_force && (r.before != r.after || r.live);
    if (did) out.append(out.empty() ? "" : ", ").append(r.name);
  }
  if (out.empty()) out.append("none");
  return out;
}

}  // namespace hamel::scene
