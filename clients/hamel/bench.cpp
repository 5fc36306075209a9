#include "clients/hamel/bench.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <thread>

#include "clients/hamel/batch.h"
#include "clients/hamel/bench_output.h"
#include "clients/hamel/gnuplot.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/runtime/signals.h"

namespace hamel::client {

namespace {

using scene::Method;

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// One line on stderr: overwritten on a terminal, else a line each ten seconds.
class Progress {
 public:
  explicit Progress(std::size_t of) : of_(of) {}
  ~Progress() {
    if (terminal_ && shown_) fmt::print(stderr, "\r\033[K");
  }
  void say(std::size_t done, const std::string& what) {
    const double now = now_s(), passed = now - began_;
    if (done < of_ && now - last_ < (terminal_ ? 0.2 : 10.0)) return;
    last_ = now;
    shown_ = true;
    const double rate = passed > 0 ? static_cast<double>(done) / passed : 0;
    const double left = rate > 0 ? static_cast<double>(of_ - done) / rate : 0;
    fmt::print(stderr, "{}{}/{} scenes, {:.1f} a second, {:.0f} s to go: {}{}", terminal_ ? "\r\033[K" : "",
               done, of_, rate, left, what, terminal_ ? "" : "\n");
    std::fflush(stderr);
  }

 private:
  const bool terminal_ = isatty(STDERR_FILENO) == 1;
  const std::size_t of_;
  const double began_ = now_s();
  double last_ = began_;
  bool shown_ = false;
};

/// Everything that is decided before the first trial.
struct Plan {
  std::vector<Cell> cells;
  std::vector<Method> methods;
  std::vector<std::string> method_names;
  std::vector<std::vector<scene::PlannerOptions>> options;  ///< [cell][method]
  std::vector<BenchRobots> robots;                          ///< one
  ArmModel model = ArmModel::prototype;
};

/// Overrides that touch `method`: "planner.kc=1" all, "gyro.kc=1" one.
std::vector<std::string> assignments(const std::vector<std::string>& overrides, const std::string& method) {
  std::vector<std::string> out;
  for (const std::string& o : overrides)
    for (const std::string& prefix : {std::string("planner."), method + "."})
      if (o.starts_with(prefix)) out.push_back(o.substr(prefix.size()));
  return out;
}

Problems choose_methods(const BenchArgs& args, Plan& plan) {
  Problems found;
  for (const Method m : {Method::gyro, Method::gyro_paper, Method::khatib, Method::attract}) {
    const std::string name = scene::to_string(m);
    if (!args.methods.empty() &&
        std::find(args.methods.begin(), args.methods.end(), name) == args.methods.end())
      continue;
    plan.methods.push_back(m);
    plan.method_names.push_back(name);
  }
  for (const std::string& m : args.methods)
    if (std::find(plan.method_names.begin(), plan.method_names.end(), m) == plan.method_names.end())
      found.push_back({"--methods " + m, "is none of gyro, gyro_paper, khatib, attract"});
  for (const std::string& o : args.overrides) {
    const std::string head = o.substr(0, o.find('.'));
    if (head != "planner" && head != "gyro" && head != "gyro_paper" && head != "khatib" && head != "attract")
      found.push_back({"--set " + o, "must begin with planner. or the name of a method"});
  }
  return found;
}

Checked<Plan> make_plan(const BenchArgs& args) {
  Plan plan;
  Problems found = choose_methods(args, plan);
  auto chosen = cells(args.families, args.spheres);
  if (!chosen) found.insert(found.end(), chosen.error().begin(), chosen.error().end());
  plan.model = args.model == "full" ? ArmModel::full : ArmModel::prototype;
  if (!args.plot_path.empty())
    if (const auto p = check_picture_name(args.plot_path)) found.push_back(*p);
  if (!found.empty()) return found;
  plan.cells = std::move(chosen).value();
  for (const Cell& cell : plan.cells) {
    auto& row = plan.options.emplace_back();
    for (std::size_t k = 0; k < plan.methods.size(); ++k) {
      row.push_back(settings(cell, plan.methods[k]));
      const Problems bad = files::set_planner(assignments(args.overrides, plan.method_names[k]), row.back());
      if (!bad.empty()) return bad;
    }
  }
  auto robots = bench_robots(plan.model);
  if (!robots) return robots.error();
  plan.robots.push_back(std::move(robots).value());
  return plan;
}

/// One scene by every method.
std::vector<Trial> try_scene(const BenchArgs& args, const Plan& plan, std::size_t cell, std::size_t index,
                             const std::function<bool()>& stop) {
  const BenchRobots& robots = plan.robots.front();
  scene::Scene s = draw_scene(plan.cells[cell], robots, plan.model, args.seed, index);
  s.dynamics.dt_s = args.dt_s;
  TrialOptions o;
  o.velocities_known = !args.velocities_unknown;
  o.now_s = now_s;
  o.stop = stop;
  if (plan.model == ArmModel::full && plan.cells[cell].family.starts_with("panda"))
    o.self_pairs = robots.panda_self_pairs;
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
                        {"set", args.overrides}}
      .dump();
}

}  // namespace

int bench_planner(const BenchArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  auto made = make_plan(args);
  if (!made) return runtime::complain("hamel bench", made.error());
  const Plan& plan = made.value();

  std::vector<CellTally> all;
  for (const Cell& cell : plan.cells)
    all.push_back({cell, plan.method_names, std::vector<Tally>(plan.methods.size())});
  const std::size_t jobs = plan.cells.size() * args.scenes;
  bool interrupted = false;
  {
    Progress progress(jobs);
    const auto asked = [&stop] { return stop.requested(); };
    Batch batch{.jobs = jobs};
    batch.workers =
        args.jobs > 0 ? args.jobs : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    batch.stop = asked;
    batch.progress = [&](std::size_t done) {
      progress.say(done, label(plan.cells[(done - 1) / args.scenes]));
    };
    run_batch(
        batch, [&](std::size_t i) { return try_scene(args, plan, i / args.scenes, i % args.scenes, asked); },
        [&](std::size_t i, std::vector<Trial> trials) {
          interrupted = interrupted || stop.requested();
          if (interrupted) return;  // the trial may have been cut short
          for (std::size_t k = 0; k < trials.size(); ++k)
            all[i / args.scenes].tallies[k].add(i % args.scenes, trials[k]);
        });
    interrupted = interrupted || stop.requested();
  }
  std::erase_if(all, [](const CellTally& c) { return c.tallies.front().size() == 0; });
  if (args.json) {
    print_json(all, settings_text(args));
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
      ->check(CLI::Range(1e-5, 0.05))
      ->type_name("SECONDS")
      ->capture_default_str();
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
}

std::optional<int> BenchVerb::run() const {
  if (planner_->parsed()) return bench_planner(args_);
  return {};
}

}  // namespace hamel::client
