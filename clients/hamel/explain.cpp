#include "clients/hamel/explain.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "clients/hamel/explain_cost.h"
#include "clients/hamel/explain_table.h"
#include "clients/hamel/progress.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/scene/reduce.h"

namespace hamel::client {

namespace {

using Json = nlohmann::ordered_json;

std::string quantity(double v, const std::string& unit) {
  return unit.empty() ? "" : fmt::format("{:.6g}", v);
}

const scene::Reduction* find(const scene::Scene& s, const std::string& name) {
  for (const scene::Reduction& r : s.reductions)
    if (r.name == name) return &r;
  return nullptr;
}

/// The error of a bounded reduction that is in force.
double measured(const Explained& e, const std::string& name) {
  for (const MeasuredError& m : e.errors)
    if (m.name == name) return m.error_m;
  return e.choosing && e.choosing->chosen ? e.choosing->chosen->joint_error : 0;
}

void print_reductions(const Explained& e) {
  fmt::print("\n  {:<10} {:<8} {:>10} {:>10}  {:<20} {}\n", "", "kind", "before", "after", "",
             "what, and why");
  for (const scene::Reduction& r : e.reduced.reductions) {
    fmt::print("{} {:<10} {:<8} {:>10} {:>10}  {:<20} {}\n", r.in_force ? '*' : ' ', r.name,
               r.exact ? "exact" : "bounded", quantity(r.before, r.unit), quantity(r.after, r.unit), r.unit,
               r.what);
    fmt::print("  {:<64}  {}\n", "", r.why);
    if (r.exact || !r.in_force) continue;
    const double found = measured(e, r.name);
    fmt::print("  {:<64}  bound {:.3g} {}, measured {:.3g}{}\n", "", r.bound, r.bound_unit, found,
               found > r.bound * (1 + 1e-9) ? ": THE BOUND DOES NOT HOLD HERE" : "");
  }
  fmt::print("* in force.  Fidelity {}.\n", scene::to_string(e.reduced.reduce.fidelity));
  for (const std::string& refused : scene::refused(e.reduced)) fmt::print("Asked for, but {}\n", refused);
}

void print_costs(const Explained& e) {
  const auto row = [&](const std::string& name, const StepCost& c) {
    fmt::print("  {:<20} {:>12.3f} {:>12} {:>12.3f} {:>10.4g} {:>8.2f} {:>14}\n", name, c.dynamics_us,
               e.written.steered ? fmt::format("{:.3f}", c.planner_us) : "-", c.total_us(), c.dt_s,
               c.of(e.full_cost), std::isfinite(c.joint_error) ? fmt::format("{:.1e}", c.joint_error) : "-");
  };
  fmt::print("\n  {:<20} {:>12} {:>12} {:>12} {:>10} {:>8} {:>14}\n", "cost of a step [us]", "dynamics",
             "planner", "both", "dt [s]", "of full", "joints [rad]");
  row("full fidelity", e.full_cost);
  for (const ReductionCost& r : e.each) row("without " + r.name, r.without);
  row("as reduced", e.reduced_cost);
  fmt::print(
      "Ticks alone, no bus; the fastest of five rounds.  Of full: over the same time of the run.  Joints: "
      "largest distance from those of full "
      "fidelity.\n");
}

void print_choice(const Explained& e) {
  if (!e.choosing) return;
  const scene::Accuracy& asked = e.written.accuracy;
  if (!e.choosing->chosen) {
    fmt::print("\nNo tier and step tried keep every joint within {:g} over {:g} s", asked.joint_error_rad,
               e.choosing->reference.horizon_s);
    fmt::print(" (the converged motion is known to {:.1e}).\n", e.choosing->reference.uncertainty);
    return;
  }
  const Setting& c = *e.choosing->chosen;
  fmt::print("\nChosen of {} tried, to keep every joint within {:g} over {:g} s: {} with dt {:.6g} s\n",
             e.choosing->tried.size(), asked.joint_error_rad, e.choosing->reference.horizon_s,
             trade::label(c.dynamics), c.dynamics.dt_s);
  fmt::print("  measured: joints {:.1e}, energy {:.1e}, {:.4g} x real time\n ", c.joint_error, c.energy_error,
             1 / c.seconds_per_s);
  for (const std::string& set : overrides(c)) fmt::print(" --set {}", set);
  fmt::print("\n");
}

Json json_of(const StepCost& c, const Explained& e) {
  return {{"dynamics_us", c.dynamics_us},
          {"planner_us", e.written.steered ? Json(c.planner_us) : Json(nullptr)},
          {"dt_s", c.dt_s},
          {"of_full", c.of(e.full_cost)},
          {"joint_error", c.joint_error}};
}

Json before_after(int before, int after) { return {{"before", before}, {"after", after}}; }

Json json_of(const Explained& e) {
  const scene::Scene& s = e.reduced;
  Json j;
  j["scene"] = s.name;
  j["fidelity"] = scene::to_string(s.reduce.fidelity);
  j["space"] = space_of(s);
  const scene::Reduction* fixed = find(s, "fixed");
  const int n = s.robot.chain.n();
  const int joints = fixed ? static_cast<int>(fixed->before) : n;
  j["links"] = before_after(joints + 1, n + 1);  // of a tree, the base among them
  j["joints"] = before_after(joints, n);
  j["obstacles"] = {{"before", e.obstacles.before}, {"after", e.obstacles.after}};
  j["tier"] = scene::to_string(s.dynamics.tier);
  j["dt_s"] = s.dynamics.dt_s;
  j["bounds"] = Json::array();
  j["reductions"] = Json::array();
  for (const scene::Reduction& r : s.reductions) {
    Json one{{"name", r.name}, {"kind", r.exact ? "exact" : "bounded"}, {"in_force", r.in_force}};
    one["what"] = r.what;
    one["why"] = r.why;
    if (!r.unit.empty()) one["before"] = r.before, one["after"] = r.after, one["unit"] = r.unit;
    j["reductions"].push_back(one);
    if (!r.exact && r.in_force)
      j["bounds"].push_back(
          {{"name", r.name}, {"bound", r.bound}, {"unit", r.bound_unit}, {"measured", measured(e, r.name)}});
  }
  j["asked_for_but"] = scene::refused(s);
  j["cost_per_step"] = {{"full", json_of(e.full_cost, e)}, {"reduced", json_of(e.reduced_cost, e)}};
  for (const ReductionCost& r : e.each) j["cost_per_step"]["without " + r.name] = json_of(r.without, e);
  j["measured_error"] =
      e.choosing && e.choosing->chosen ? e.choosing->chosen->joint_error : e.reduced_cost.joint_error;
  return j;
}

void print_text(const Explained& e) {
  const scene::Scene& s = e.reduced;
  fmt::print(
      "{}: {} in {}, {} joints, {} dt {:.6g} s{}\n", s.name, s.robot.name, space_of(s), s.robot.chain.n(),
      trade::label(s.dynamics), s.dynamics.dt_s,
      s.steered ? fmt::format(", a planner cycle every {} steps", s.planner.period_steps) : ", free motion");
  if (s.steered)
    fmt::print("obstacles: {} at most, the planner is handed {}\n", e.obstacles.before, e.obstacles.after);
  print_reductions(e);
  print_costs(e);
  print_choice(e);
}

}  // namespace

int explain(const ExplainArgs& args) {
  runtime::start_log("hamel", false);
  std::vector<scene::Scene> scenes;
  for (const std::string& path : args.scene_paths) {
    auto s = files::read_scene(path, args.overrides);
    if (!s) return runtime::complain("hamel explain", s.error());
    scenes.push_back(std::move(s).value());
  }
  Doing doing;
  trade::Watch watch = steady_watch();
  watch.tell = [&](const std::string& what) { doing.say(what); };
  if (args.table) return print_table(scenes, watch);
  if (scenes.size() != 1)
    return runtime::complain("hamel explain", {{"SCENE", "one at a time, or several with --table"}});
  const Explained e = explain_scene(scenes.front(), args.seconds, watch);
  doing.say("");
  if (args.json)
    fmt::print("{}\n", json_of(e).dump(2));
  else
    print_text(e);
  return runtime::kDone;
}

}  // namespace hamel::client
