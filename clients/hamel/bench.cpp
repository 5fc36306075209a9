#include "clients/hamel/bench.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "clients/hamel/batch.h"
#include "clients/hamel/bench_output.h"
#include "clients/hamel/bench_streams.h"
#include "clients/hamel/gnuplot.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/problems.h"
#include "clients/hamel/progress.h"
#include "clients/hamel/timing.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/runtime/signals.h"

namespace hamel::client {

namespace {

using scene::Method;

/// Everything that is decided before the first trial.
struct Plan {
  std::vector<Cell> cells;
  std::vector<std::vector<scene::Scene>> given;           ///< [cell] the scenes, where they are not drawn
  std::vector<std::pair<std::size_t, std::size_t>> jobs;  ///< (cell, scene)
  std::vector<Method> methods;
  std::vector<std::string> method_names;
  std::vector<std::vector<scene::PlannerOptions>> options;  ///< [cell][method]
  std::vector<BenchRobots> robots;                          ///< one
  ArmModel model = ArmModel::prototype;
};

}  // namespace

/// Overrides that touch `method`: "planner.kc=1" all, "gyro.kc=1" one.
std::vector<std::string> assignments(const std::vector<std::string>& overrides, const std::string& method) {
  std::vector<std::string> out;
  for (const std::string& o : overrides)
    for (const std::string& prefix : {std::string("planner."), method + "."})
      if (o.starts_with(prefix)) out.push_back(o.substr(prefix.size()));
  return out;
}

Problems choose_methods(const BenchArgs& args, std::vector<Method>& methods,
                        std::vector<std::string>& names) {
  Problems found;
  for (const Method m : {Method::gyro, Method::gyro_paper, Method::khatib, Method::attract}) {
    const std::string name = scene::to_string(m);
    if (!args.methods.empty() &&
        std::find(args.methods.begin(), args.methods.end(), name) == args.methods.end())
      continue;
    methods.push_back(m);
    names.push_back(name);
  }
  for (const std::string& m : args.methods)
    if (std::find(names.begin(), names.end(), m) == names.end())
      found.push_back({"--methods " + m, "is none of gyro, gyro_paper, khatib, attract"});
  for (const std::string& o : args.overrides) {
    const std::string head = o.substr(0, o.find('.'));
    if (head != "planner" && head != "gyro" && head != "gyro_paper" && head != "khatib" && head != "attract")
      found.push_back({"--set " + o, "must begin with planner. or the name of a method"});
  }
  return found;
}

namespace {

Checked<Plan> make_plan(const BenchArgs& args) {
  Plan plan;
  Problems found = choose_methods(args, plan.methods, plan.method_names);
  if (args.problems_folder.empty()) {
    auto chosen = cells(args.families, args.spheres);
    if (chosen)
      plan.cells = std::move(chosen).value();
    else
      found.insert(found.end(), chosen.error().begin(), chosen.error().end());
  }
  plan.model = args.model == "full" ? ArmModel::full : ArmModel::prototype;
  for (const auto& [option, path] : {std::pair{"--csv", args.csv_path}, {"--plot", args.plot_path}})
    if (const auto p = output_problem(option, path, {})) found.push_back(*p);
  for (const std::string& o : args.overrides)
    if (o.substr(o.find('.') + 1).starts_with("method"))
      found.push_back({"--set " + o, "methods are chosen by --methods"});
  if (!args.plot_path.empty())
    if (const auto p = check_picture_name(args.plot_path)) found.push_back(*p);
  if (!found.empty()) return found;
  auto robots = bench_robots(plan.model);
  if (!robots) return robots.error();
  plan.robots.push_back(std::move(robots).value());
  if (!args.problems_folder.empty()) {
    auto sets = load_problems(args.problems_folder, plan.robots.front().panda);
    if (!sets) return sets.error();
    for (ProblemSet& set : sets.value()) {
      plan.cells.push_back({set.name, 0, ""});
      plan.given.push_back(std::move(set.scenes));
    }
  }
  for (const Cell& cell : plan.cells) {
    auto& row = plan.options.emplace_back();
    for (std::size_t k = 0; k < plan.methods.size(); ++k) {
      row.push_back(settings(cell, plan.methods[k]));
      const Problems bad = files::set_planner(assignments(args.overrides, plan.method_names[k]), row.back());
      if (!bad.empty()) return bad;
    }
  }
  for (std::size_t c = 0; c < plan.cells.size(); ++c) {
    const std::size_t scenes = plan.given.empty() ? args.scenes : plan.given[c].size();
    for (std::size_t i = 0; i < scenes; ++i) plan.jobs.emplace_back(c, i);
  }
  return plan;
}

/// One scene by every method.
std::vector<Trial> try_scene(const BenchArgs& args, const Plan& plan, std::size_t cell, std::size_t index,
                             const std::function<bool()>& stop) {
  const BenchRobots& robots = plan.robots.front();
  scene::Scene s =
      plan.given.empty() ? draw_scene(plan.cells[cell], robots, args.seed, index) : plan.given[cell][index];
  s.dynamics.dt_s = args.dt_s;
  TrialOptions o;
  o.velocities_known = !args.velocities_unknown;
  o.latency_s = args.latency_s;
  o.now_s = now_s;
  o.stop = stop;
  std::vector<Trial> out;
  for (const scene::PlannerOptions& options : plan.options[cell]) {
    s.planner = options;
    out.push_back(run_trial(s, o));
  }
  return out;
}

std::string settings_text(const BenchArgs& args) {
  return nlohmann::json{{"seed", args.seed},
                        {"scenes", args.scenes},
                        {"model", args.model},
                        {"dt_s", args.dt_s},
                        {"velocities_known", !args.velocities_unknown},
                        {"latency_s", args.latency_s},
                        {"set", args.overrides}}
      .dump();
}

}  // namespace

int bench_planner(const BenchArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  if (!args.streams_folder.empty()) return bench_streams(args, [&stop] { return stop.requested(); });
  auto made = make_plan(args);
  if (!made) return runtime::complain("hamel bench", made.error());
  const Plan& plan = made.value();

  std::vector<CellTally> all;
  for (const Cell& cell : plan.cells)
    all.push_back({cell, plan.method_names, std::vector<Tally>(plan.methods.size())});
  bool interrupted = false;
  {
    Progress progress(plan.jobs.size(), "scenes");
    const auto asked = [&stop] { return stop.requested(); };
    Batch batch{.jobs = plan.jobs.size()};
    batch.workers = workers(args.jobs);
    batch.stop = asked;
    batch.progress = [&](std::size_t done) {
      progress.say(done, label(plan.cells[plan.jobs[done - 1].first]));
    };
    run_batch(
        batch,
        [&](std::size_t i) { return try_scene(args, plan, plan.jobs[i].first, plan.jobs[i].second, asked); },
        [&](std::size_t i, std::vector<Trial> trials) {
          interrupted = interrupted || stop.requested();
          if (interrupted) return;  // the trial may have been cut short
          for (std::size_t k = 0; k < trials.size(); ++k)
            all[plan.jobs[i].first].tallies[k].add(plan.jobs[i].second, trials[k]);
        });
    interrupted = interrupted || stop.requested();
  }
  std::erase_if(all, [](const CellTally& c) { return c.tallies.front().size() == 0; });
  if (args.json) {
    print_json(all, settings_text(args), interrupted);
  } else {
    fmt::print("hamel bench planner: model {}, seed {}, dt {:g} s{}\n", args.model, args.seed, args.dt_s,
               args.velocities_unknown ? ", obstacles' velocities unknown" : "");
    if (!all.empty()) print_table(all);
  }
  if (!args.csv_path.empty())
    if (const auto p = write_csv(args.csv_path, all)) return runtime::complain("hamel bench", {*p});
  if (!args.plot_path.empty() && !all.empty())
    if (const auto p =
            draw_rates(args.plot_path, fmt::format("hamel bench planner, seed {}", args.seed), all))
      return runtime::complain("hamel bench", {*p});
  if (interrupted) say_interrupted("scenes");
  return interrupted ? runtime::kInterrupted : runtime::kDone;
}

BenchVerb::BenchVerb(CLI::App& app) {
  auto* bench = app.add_subcommand("bench", "measure over many scenes");
  bench->require_subcommand(1);
  planner_ = bench->add_subcommand(
      "planner", "planning methods side by side on random scenes: reached, contact, stuck, times");
  planner_
      ->add_option(
          "--family", args_.families,
          "planar_static, planar_moving, panda_static, panda_moving, example_5_2; several with commas")
      ->delimiter(',')
      ->type_name("NAME");
  planner_->add_option("--methods", args_.methods, "gyro, gyro_paper, khatib, attract; several with commas")
      ->delimiter(',')
      ->type_name("NAME");
  planner_
      ->add_option("--problems", args_.problems_folder,
                   "MoveIt's planning problems (scene*.yaml, request*.yaml) for the Panda instead")
      ->type_name("DIR");
  planner_
      ->add_option("--streams", args_.streams_folder,
                   "the Panda goes from goal to goal in front of recorded streams (*.csv) instead")
      ->type_name("DIR")
      ->excludes("--problems");
  planner_->add_option("--spheres", args_.spheres, "only the cells with so many spheres")
      ->delimiter(',')
      ->type_name("N");
  planner_->add_option("--scenes", args_.scenes, "of each cell")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  planner_->add_option("--seed", args_.seed, "of the scenes; the same for every method")
      ->capture_default_str();
  planner_
      ->add_option("--model", args_.model,
                   "prototype: no gravity, no torque limits; full: both, and self-collision")
      ->check(CLI::IsMember({"prototype", "full"}))
      ->capture_default_str();
  planner_->add_option("--dt", args_.dt_s, "step of arm and planner")
      ->check(runtime::between(1e-5, 0.05))
      ->type_name("SECONDS")
      ->capture_default_str();
  planner_->add_option("--latency", args_.latency_s, "age of what the planner is told of the obstacles")
      ->check(runtime::between(0, 10))
      ->type_name("SECONDS");
  planner_->add_flag("--velocity-unknown", args_.velocities_unknown,
                     "the planner is not told how obstacles move");
  planner_->add_option("--jobs", args_.jobs, "threads; the result does not depend on them")
      ->check(CLI::Range(1, 1024));
  planner_
      ->add_option("--set", args_.overrides,
                   "planner.FIELD=VALUE for all methods, METHOD.FIELD=VALUE for one")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  planner_->add_option("--csv", args_.csv_path, "write every trial")->type_name("FILE");
  planner_->add_option("--plot", args_.plot_path, "draw the rates, .svg or .png (needs gnuplot)")
      ->type_name("FILE");
  planner_->add_flag("--json", args_.json, "one JSON object on stdout instead of the table");
  reduce_ = bench->add_subcommand(
      "reduce", "what leaving out buys: 1,000 obstacles, 16 and 256 spheres, panda_reach; ticks alone");
  reduce_->add_flag("--json", reduce_args_.json, "one JSON object");
  reduce_->add_flag("--assert", reduce_args_.check, "exit code 1 where a promise is broken");
}

std::optional<int> BenchVerb::run() const {
  if (planner_->parsed()) return bench_planner(args_);
  if (reduce_->parsed()) return bench_reduce(reduce_args_);
  return {};
}

}  // namespace hamel::client
