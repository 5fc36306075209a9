#include "clients/hamel/print.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/scene/reduce.h"

namespace hamel::client {

namespace {

/// Share of the energy scale that an integrator may make up before the table says that it did.
constexpr double kDriftOfConcern = 0.05;

nlohmann::ordered_json number(double v) {
  if (!std::isfinite(v)) return nullptr;
  return v;
}

nlohmann::ordered_json text(const std::string& s) {
  if (s.empty()) return nullptr;
  return s;
}

}  // namespace

void print_json(const scene::Scene& scene, const Outcome& o) {
  nlohmann::ordered_json j;
  j["scene"] = scene.name;
  j["method"] = scene.steered ? nlohmann::ordered_json(scene::to_string(scene.planner.method)) : nullptr;
  j["tier"] = scene::to_string(scene.dynamics.tier);
  j["dt_s"] = scene.dynamics.dt_s;
  j["outcome"] = o.outcome;
  j["reason"] = text(o.reason);
  j["detail"] = text(o.detail);
  j["time_to_goal_s"] = o.time_to_goal_s < 0 ? nlohmann::ordered_json(nullptr) : number(o.time_to_goal_s);
  j["final_error_m"] = scene.steered ? number(o.final_error_m) : nlohmann::ordered_json(nullptr);
  j["min_clearance_m"] = number(o.min_clearance_m);
  j["contacts"] = o.contacts;
  j["path_length_m"] = scene.steered ? number(o.path_length_m) : nlohmann::ordered_json(nullptr);
  j["energy_drift_rel"] = number(o.summary.energy_drift_rel);
  j["iterations_mean"] = number(o.summary.iterations_mean);
  j["iterations_max"] = o.summary.iterations_max;
  j["residual_max_Nm"] = number(o.summary.residual_max_Nm);
  j["fidelity"] = scene::to_string(scene.reduce.fidelity);
  j["reductions"] = scene::names_in_force(scene);
  j["asked_for_but"] = scene::refused(scene);
  j["steps"] = o.summary.steps;
  j["substepped"] = o.summary.substepped;
  j["commands_missed"] = o.summary.commands_missed;
  j["deadlines_missed"] = o.summary.deadlines_missed;
  j["restarts"] = o.restarts;
  j["outages"] = nlohmann::ordered_json::array();
  for (const auto& out : o.outages)
    j["outages"].push_back({{"service", out.service}, {"t_s", out.t_s}, {"length_s", out.length_s}});
  j["outages_not_listed"] = o.outages_more;
  j["wall_s"] = number(o.wall_s);
  j["real_time_factor"] = number(o.wall_s > 0 ? o.t_s / o.wall_s : 0);
  j["trajectory_hash"] = o.summary.trajectory_hash;
  fmt::print("{}\n", j.dump(2));
}

void print_table(const scene::Scene& scene, const Outcome& o, const std::string& pace,
                 const std::string& bus) {
  const auto line = [](const char* name, const std::string& value) {
    fmt::print("  {:<18} {}\n", name, value);
  };
  const auto si = [](double v, const char* unit) {
    return std::isfinite(v) ? fmt::format("{:.4g} {}", v, unit) : "-";
  };
  fmt::print("{} ({}, {}, dt {} s, {}, {})\n", scene.name, scene.robot.name,
             scene::to_string(scene.dynamics.tier), scene.dynamics.dt_s, pace, bus);
  line("outcome", o.outcome + (o.reason.empty() ? "" : " (" + o.reason + ")"));
  if (!o.detail.empty()) line("", o.detail);
  if (scene.steered) {
    line("method", scene::to_string(scene.planner.method));
    line("time to goal", o.time_to_goal_s < 0 ? "-" : si(o.time_to_goal_s, "s"));
    line("final error", si(o.final_error_m, "m"));
    line("min clearance", si(o.min_clearance_m, "m"));
    line("contacts", fmt::format("{}", o.contacts));
    line("path length", si(o.path_length_m, "m"));
  }
  line("reductions", scene::names_in_force(scene));
  for (const std::string& refused : scene::refused(scene)) line("asked for, but", refused);
  const bool lost = o.summary.energy_drift_rel > kDriftOfConcern;
  line("energy drift", fmt::format("{:.2e} of the energy scale{}", o.summary.energy_drift_rel,
                                   lost ? ": the step is too long for this motion, do not trust it" : ""));
  line("iterations", fmt::format("mean {:.2f}, max {}", o.summary.iterations_mean, o.summary.iterations_max));
  line("residual max", fmt::format("{:.2e} N m", o.summary.residual_max_Nm));
  line("steps", fmt::format("{}{}", o.summary.steps,
                            o.summary.substepped ? fmt::format(" ({} divided)", o.summary.substepped) : ""));
  line("wall time",
       fmt::format("{:.2f} s ({:.3g} x real time)", o.wall_s, o.wall_s > 0 ? o.t_s / o.wall_s : 0));
  if (o.summary.commands_missed || o.summary.deadlines_missed)
    line("missed", fmt::format("{} steps without a fresh command, {} deadlines", o.summary.commands_missed,
                               o.summary.deadlines_missed));
  if (o.restarts) line("restarts", fmt::format("{}", o.restarts));
  for (std::size_t i = 0; i < std::min<std::size_t>(o.outages.size(), 10); ++i)
    line(i == 0 ? "outages" : "", fmt::format("{} at t = {:.3f} s for {:.3f} s", o.outages[i].service,
                                              o.outages[i].t_s, o.outages[i].length_s));
  if (o.outages.size() > 10) line("", fmt::format("and {} more", o.outages.size() - 10 + o.outages_more));
  if (o.rows_lost) line("unseen states", fmt::format("{}", o.rows_lost));
  line("trajectory hash", o.summary.trajectory_hash);
}

}  // namespace hamel::client
