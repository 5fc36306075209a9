#include "clients/hamel/bench.h"

#include <fmt/format.h>

#include <atomic>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "clients/hamel/batch.h"
#include "clients/hamel/bench_drawing.h"
#include "clients/hamel/bench_output.h"
#include "clients/hamel/bench_promises.h"
#include "clients/hamel/bench_streams.h"
#include "clients/hamel/gnuplot.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/problems.h"
#include "clients/hamel/progress.h"
#include "clients/hamel/timing.h"
#include "common/base/hash.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/runtime/signals.h"

namespace hamel::client {

namespace {

using scene::Method;

constexpr double kEarliestDropout_s = 0.3, kLatestDropout_s = 1.5;

/// Everything that is decided before the first trial.
struct Plan {
  std::vector<Cell> cells;
  std::vector<std::vector<scene::Scene>> given;           ///< [cell] the scenes, where they are not drawn
  std::vector<std::pair<std::size_t, std::size_t>> jobs;  ///< (cell, scene)
  std::vector<Method> methods;
  std::vector<std::string> method_names;
  std::vector<BenchRobots> robots;  ///< one
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
  for (const Cell& cell : plan.cells)
    for (std::size_t k = 0; k < plan.methods.size(); ++k) {
      scene::PlannerOptions options = settings(cell, plan.methods[k]);
      const Problems bad = files::set_planner(assignments(args.overrides, plan.method_names[k]), options);
      if (!bad.empty()) return bad;
    }
  for (std::size_t c = 0; c < plan.cells.size(); ++c) {
    const std::size_t scenes =
        plan.given.empty() ? scenes_of(plan.cells[c], args.scenes) : plan.given[c].size();
    for (std::size_t i = 0; i < scenes; ++i) plan.jobs.emplace_back(c, i);
  }
  return plan;
}

/// The best of several trials, each but the first by way of a random configuration: what a planner that
/// foresees everything could choose from.
Trial best_trial(const scene::Scene& s, TrialOptions options, int of, std::uint64_t seed) {
  Trial first = run_trial(s, options);
  Dice dice(seed);
  for (int k = 1; k < of && first.ending != Ending::reached; ++k) {
    options.by_way_of = random_configuration(s.robot.chain, dice);
    Trial next = run_trial(s, options);
    if (next.ending == Ending::reached) return next;
  }
  return first;
}

/// One scene by every method, or why there is none.
Checked<std::vector<Trial>> try_scene(const BenchArgs& args, const Plan& plan, std::size_t cell,
                                      std::size_t index, const std::function<bool()>& stop) {
  Checked<scene::Scene> drawn =
      plan.given.empty() ? draw_scene(plan.cells[cell], plan.robots.front(), args.seed, index, stop)
                         : plan.given[cell][index];
  if (!drawn) return drawn.error();
  scene::Scene& s = drawn.value();
  if (!has_own_step(plan.cells[cell])) s.dynamics.dt_s = args.dt_s;
  if (args.duration_s > 0) s.duration_s = args.duration_s;
  const std::uint64_t seed = hashed(s.name, kHashStart ^ args.seed);
  TrialOptions o;
  o.velocities_known = !args.velocities_unknown;
  o.latency_s = args.latency_s;
  o.rate_hz = args.rate_hz;
  if (args.dropout) o.dropout_s = Dice(seed).uniform(kEarliestDropout_s, kLatestDropout_s);
  o.now_s = now_s;
  o.stop = stop;
  std::vector<Trial> out;
  for (std::size_t k = 0; k < plan.methods.size(); ++k) {
    s.planner = settings(plan.cells[cell], plan.methods[k], index);
    const Problems bad = files::set_planner(assignments(args.overrides, plan.method_names[k]), s.planner);
    if (!bad.empty()) return bad;
    out.push_back(best_trial(s, o, args.best_of, seed));
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
                        {"rate_hz", args.rate_hz},
                        {"duration_s", args.duration_s},
                        {"dropout", args.dropout},
                        {"best_of", args.best_of},
                        {"set", args.overrides}}
      .dump();
}

/// Says on standard error what is missed.
int check_promises(const std::vector<CellTally>& all, const BenchArgs& args) {
  scene::PlannerOptions gyro;
  files::set_planner(assignments(args.overrides, "gyro"), gyro);  // valid: it was used
  const auto missed = missed_promises(all, {.dt_s = args.dt_s, .rollouts = gyro.escapes > 0});
  for (const std::string& line : missed) fmt::print(stderr, "missed: {}\n", line);
  return missed.empty() ? runtime::kDone : runtime::kFailed;
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
  Problems found;
  {
    Progress progress(plan.jobs.size(), "scenes");
    std::atomic<bool> failed{false};
    const auto asked = [&] { return stop.requested() || failed; };
    Batch batch{.jobs = plan.jobs.size()};
    batch.workers = workers(args.jobs);
    batch.stop = asked;
    batch.progress = [&](std::size_t done) {
      progress.say(done, label(plan.cells[plan.jobs[done - 1].first]));
    };
    run_batch(
        batch,
        [&](std::size_t i) { return try_scene(args, plan, plan.jobs[i].first, plan.jobs[i].second, asked); },
        [&](std::size_t i, Checked<std::vector<Trial>> trials) {
          interrupted = interrupted || stop.requested();
          if (interrupted || failed) return;  // the trial may have been cut short
          if (!trials) {
            found = trials.error();
            failed = true;
            return;
          }
          for (std::size_t k = 0; k < trials.value().size(); ++k)
            all[plan.jobs[i].first].tallies[k].add(plan.jobs[i].second, trials.value()[k]);
        });
    interrupted = interrupted || stop.requested();
  }
  if (!found.empty()) return runtime::complain("hamel bench", found);
  std::erase_if(all, [](const CellTally& c) { return c.tallies.front().size() == 0; });
  if (args.json) {
    print_json(all, settings_text(args), interrupted);
  } else {
    fmt::print("hamel bench planner: model {}, seed {}, dt {:g} s{}\n", args.model, args.seed, args.dt_s,
               args.velocities_unknown ? ", obstacles' velocities unknown" : "");
    if (!all.empty()) args.dropout ? print_dropouts(all) : print_table(all);
  }
  if (!args.csv_path.empty())
    if (const auto p = write_csv(args.csv_path, all)) return runtime::complain("hamel bench", {*p});
  if (!args.plot_path.empty() && !all.empty())
    if (const auto p =
            draw_rates(args.plot_path, fmt::format("hamel bench planner, seed {}", args.seed), all))
      return runtime::complain("hamel bench", {*p});
  if (interrupted) {
    say_interrupted("scenes");
    return runtime::kInterrupted;
  }
  return args.check ? check_promises(all, args) : runtime::kDone;
}

BenchVerb::BenchVerb(CLI::App& app) {
  auto* bench = app.add_subcommand("bench", "measure over many scenes");
  bench->require_subcommand(1);
  planner_ = bench->add_subcommand(
      "planner", "planning methods side by side on random scenes: reached, contact, stuck, times");
  add_scenes();
  add_conditions();
  planner_->add_option("--csv", args_.csv_path, "write every trial")->type_name("FILE");
  planner_->add_option("--plot", args_.plot_path, "draw the rates, .svg or .png (needs gnuplot)")
      ->type_name("FILE");
  planner_->add_flag("--json", args_.json, "one JSON object on stdout instead of the table");
  planner_->add_flag("--assert", args_.check,
                     "exit code 1 where gyro misses what is promised of reach, contacts, cycle time");
  // What a folder of given scenes leaves nothing to choose of.
  for (const char* option : {"--family", "--spheres", "--scenes", "--seed", "--assert"})
    for (const char* folder : {"--problems", "--streams"})
      planner_->get_option(folder)->excludes(planner_->get_option(option));
  for (const char* option : {"--problems", "--plot", "--rate", "--duration", "--dropout", "--best-of"})
    planner_->get_option("--streams")->excludes(planner_->get_option(option));
  for (const char* option : {"--json", "--plot", "--assert", "--best-of", "--problems"})
    planner_->get_option("--dropout")->excludes(planner_->get_option(option));
  reduce_ = bench->add_subcommand(
      "reduce", "what leaving out buys: 1,000 obstacles, 16 and 256 spheres, panda_reach; ticks alone");
  reduce_->add_flag("--json", reduce_args_.json, "one JSON object");
  reduce_->add_flag("--assert", reduce_args_.check, "exit code 1 where a promise is broken");
}

void BenchVerb::add_scenes() {
  planner_->add_option("--family", args_.families, std::string(kFamilies) + "; several with commas")
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
      ->type_name("DIR");
  planner_->add_option("--spheres", args_.spheres, "only the cells with so many spheres")
      ->delimiter(',')
      ->type_name("N");
  planner_->add_option("--scenes", args_.scenes, "of each cell; the grid has its own number")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  planner_->add_option("--seed", args_.seed, "of the scenes; the same for every method")
      ->capture_default_str();
}

void BenchVerb::add_conditions() {
  planner_
      ->add_option("--model", args_.model,
                   "prototype: no gravity, no torque limits; full: both, and self-collision")
      ->check(CLI::IsMember({"prototype", "full"}))
      ->capture_default_str();
  planner_->add_option("--dt", args_.dt_s, "step of arm and planner; the grid has its own")
      ->check(runtime::between(1e-5, 0.05))
      ->type_name("SECONDS")
      ->capture_default_str();
  planner_->add_option("--duration", args_.duration_s, "a trial ends then; else the family's own limit")
      ->check(runtime::between(0.01, 3600))
      ->type_name("SECONDS");
  planner_->add_option("--latency", args_.latency_s, "age of what the planner is told of the obstacles")
      ->check(runtime::between(0, 10))
      ->type_name("SECONDS");
  planner_->add_option("--rate", args_.rate_hz, "the planner is told of the obstacles so often; else always")
      ->check(runtime::between(0.1, 10000))
      ->type_name("HZ");
  planner_->add_flag("--velocity-unknown", args_.velocities_unknown,
                     "the planner is not told how obstacles move");
  planner_->add_flag("--dropout", args_.dropout,
                     "the planner is told nothing more from 0.3 to 1.5 s on: how arms stop");
  planner_
      ->add_option("--best-of", args_.best_of,
                   "up to so many trials of a scene, by way of random configurations; the first that reaches")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  planner_->add_option("--jobs", args_.jobs, "threads; the result does not depend on them")
      ->check(CLI::Range(1, 1024));
  planner_
      ->add_option("--set", args_.overrides,
                   "planner.FIELD=VALUE for all methods, METHOD.FIELD=VALUE for one")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
}

std::optional<int> BenchVerb::run() const {
  if (planner_->parsed()) return bench_planner(args_);
  if (reduce_->parsed()) return bench_reduce(reduce_args_);
  return {};
}

}  // namespace hamel::client
