#include "clients/hamel/bench_streams.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "clients/hamel/batch.h"
#include "clients/hamel/bench_families.h"
#include "clients/hamel/bench_output.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/progress.h"
#include "clients/hamel/trial.h"
#include "common/files/scene_text.h"
#include "common/runtime/options.h"

namespace hamel::client {

namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double kBaseRoom_m = 0.3;
constexpr double kAssumedSpeed_mps = 1;  // of a sphere whose velocity is not known

/// A stream and what is odd about it.
struct Recording {
  std::string name;
  scene::Stream stream;
  double length_s = 0;
  int glitches = 0;  ///< samples reached faster than Stream::glitch_mps
};

/// One trial of the table.
struct Job {
  std::size_t recording = 0, method = 0;
  bool empty = false;
};

/// Nobody comes nearer to the base's axis than kBaseRoom_m.
bool spares_base(const scene::Stream& s, double x_m) {
  return std::all_of(s.samples.begin(), s.samples.end(), [&](const scene::StreamSample& p) {
    return std::hypot(p.p_m.x() + x_m, p.p_m.y()) - p.shape.dims_m[0] >= kBaseRoom_m;
  });
}

int count_glitches(const scene::Stream& s) {
  std::map<std::uint32_t, scene::StreamSample> last;
  int count = 0;
  for (const scene::StreamSample& p : s.samples) {
    const auto before = last.find(p.id);
    if (before != last.end() && p.t_s > before->second.t_s)
      count += (p.p_m - before->second.p_m).norm() > s.glitch_mps * (p.t_s - before->second.t_s);
    last[p.id] = p;
  }
  return count;
}

Checked<std::vector<Recording>> load_streams(const std::string& folder) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.path().extension() == ".csv") paths.push_back(entry.path());
  if (error) return Problems{{folder, error.message()}};
  if (paths.empty()) return Problems{{folder, "holds no *.csv"}};
  std::sort(paths.begin(), paths.end());
  Problems found;
  std::vector<Recording> all;
  for (const fs::path& path : paths) {
    const auto text = files::read_file(path.string());
    auto samples = text ? scene::parse_stream(text.value(), path.string())
                        : Checked<std::vector<scene::StreamSample>>(text.error());
    if (!samples) {
      found.insert(found.end(), samples.error().begin(), samples.error().end());
      continue;
    }
    Recording r{path.stem().string(), {}, 0, 0};
    r.stream.path = path.string();
    r.stream.samples = std::move(samples).value();
    r.stream.start_s = r.stream.samples.front().t_s;
    r.length_s = r.stream.samples.back().t_s - r.stream.start_s;
    while (!spares_base(r.stream, r.stream.X_WS.p.x()) && r.stream.X_WS.p.x() < 100)
      r.stream.X_WS.p.x() += 0.05;
    r.glitches = count_glitches(r.stream);
    all.push_back(std::move(r));
  }
  if (!found.empty()) return found;
  return all;
}

std::vector<scene::Goal> goals() {
  std::vector<scene::Goal> all;
  for (const Vector3d& p : {Vector3d(0.45, 0.4, 0.35), Vector3d(0.5, -0.35, 0.4), Vector3d(0.55, 0.1, 0.3),
                            Vector3d(0.4, 0.3, 0.6)}) {
    scene::Goal& g = all.emplace_back();
    g.id = 1;
    g.X_WG.p = p;
  }
  return all;
}

scene::Scene scene_of(const Recording& r, const scene::Robot& robot, bool empty, const BenchArgs& args) {
  scene::Scene s{r.name, "", 1,  robot, {}, {},         {},
                 true,   {}, {}, {},    {}, r.length_s, scene::StopRule::at_duration};
  s.q0.resize(7);
  s.q0 << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  s.qd0 = Eigen::VectorXd::Zero(7);
  s.goal = goals().front();
  s.dynamics.dt_s = args.dt_s;
  if (!empty) s.perception.stream = r.stream;
  return s;
}

struct Row {
  Job job;
  Trial trial;
};

double a_minute(const Row& row) {
  return row.trial.end_s > 0 ? 60 * row.trial.goals_reached / row.trial.end_s : 0;
}

void print_rows(const std::vector<Recording>& recordings, const std::vector<std::string>& methods,
                const std::vector<Row>& rows) {
  fmt::print("  {:<22}{:<11}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}\n", "stream", "method", "length s",
             "glitches", "goals", "a minute", "empty", "by arm", "by other", "UNSAFE %", "nearest");
  for (const Row& row : rows) {
    if (row.job.empty) continue;
    const Recording& r = recordings[row.job.recording];
    const auto empty = std::find_if(rows.begin(), rows.end(), [&](const Row& x) {
      return x.job.empty && x.job.recording == row.job.recording && x.job.method == row.job.method;
    });
    fmt::print("  {:<22}{:<11}{:>9.1f}{:>9}{:>9}{:>9.1f}{:>9.1f}{:>9}{:>9}{:>9.1f}{:>10.4f}\n", r.name,
               methods[row.job.method], row.trial.end_s, r.glitches, row.trial.goals_reached, a_minute(row),
               empty == rows.end() ? std::nan("") : a_minute(*empty), row.trial.contacts_by_arm,
               row.trial.contacts_by_others,
               100 * static_cast<double>(row.trial.unsafe_cycles) / static_cast<double>(row.trial.cycles),
               row.trial.clearance_min_m);
    if (row.trial.contact)
      fmt::print("    {} contact at t = {:.3f} s: {} and obstacle {}\n",
                 row.trial.contact->arm_caused ? "arm-caused" : "other", row.trial.contact->t_s,
                 row.trial.contact->who, row.trial.contact->other);
  }
  fmt::print(
      "\nGoals in a cycle of four, each given up after 20 s; empty: goals a minute without the stream.  "
      "Contacts by "
      "FCL on the full shapes,\ncounted where they begin; by arm: the arm moved into it.  nearest: smallest "
      "distance "
      "[m].  glitches: samples faster than 10 m/s.\n");
}

void print_json(const std::vector<Recording>& recordings, const std::vector<std::string>& methods,
                const std::vector<Row>& rows) {
  nlohmann::json out = nlohmann::json::array();
  for (const Row& row : rows)
    out.push_back({{"stream", row.job.empty ? "" : recordings[row.job.recording].name},
                   {"method", methods[row.job.method]},
                   {"length_s", row.trial.end_s},
                   {"glitches", row.job.empty ? 0 : recordings[row.job.recording].glitches},
                   {"goals_reached", row.trial.goals_reached},
                   {"goals_missed", row.trial.goals_missed},
                   {"contacts_by_arm", row.trial.contacts_by_arm},
                   {"contacts_by_others", row.trial.contacts_by_others},
                   {"contacts_unreported_cycles", row.trial.unreported_contacts},
                   {"unsafe_cycles", row.trial.unsafe_cycles},
                   {"cycles", row.trial.cycles}});
  fmt::print("{}\n", out.dump(1));
}

/// A line for each run.
std::optional<Problem> write_rows(const std::string& path, const std::vector<Recording>& recordings,
                                  const std::vector<std::string>& methods, const std::vector<Row>& rows) {
  std::ofstream out(path);
  out << "stream,method,end_s,glitches,goals_reached,goals_missed,contacts_by_arm,contacts_by_others,"
         "contacts_"
         "unreported_cycles,unsafe_cycles,cycles,clearance_min_m\n";
  for (const Row& row : rows) {
    const Trial& t = row.trial;
    out << fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n",
                       row.job.empty ? "" : recordings[row.job.recording].name, methods[row.job.method],
                       t.end_s, row.job.empty ? 0 : recordings[row.job.recording].glitches, t.goals_reached,
                       t.goals_missed, t.contacts_by_arm, t.contacts_by_others, t.unreported_contacts,
                       t.unsafe_cycles, t.cycles, t.clearance_min_m);
  }
  out.flush();
  if (!out) return Problem{path, "cannot be written"};
  return std::nullopt;
}

}  // namespace

int bench_streams(const BenchArgs& args, const std::function<bool()>& stop) {
  std::vector<scene::Method> methods;
  std::vector<std::string> names;
  Problems found = choose_methods(args, methods, names);
  auto recordings = load_streams(args.streams_folder);
  if (!recordings) found.insert(found.end(), recordings.error().begin(), recordings.error().end());
  auto robots = bench_robots(args.model == "full" ? ArmModel::full : ArmModel::prototype);
  if (!robots) found.insert(found.end(), robots.error().begin(), robots.error().end());
  std::vector<scene::PlannerOptions> options;
  for (std::size_t k = 0; k < methods.size() && found.empty(); ++k) {
    options.push_back(settings({"panda_moving", 8, ""}, methods[k]));
    options.back().assumed_speed_mps = kAssumedSpeed_mps;
    const Problems bad = files::set_planner(assignments(args.overrides, names[k]), options.back());
    found.insert(found.end(), bad.begin(), bad.end());
  }
  if (const auto p = output_problem("--csv", args.csv_path, {})) found.push_back(*p);
  if (!found.empty()) return runtime::complain("hamel bench", found);

  std::vector<Job> jobs;
  for (std::size_t r = 0; r < recordings.value().size(); ++r)
    for (std::size_t m = 0; m < methods.size(); ++m)
      for (const bool empty : {false, true}) jobs.push_back({r, m, empty});
  std::vector<Row> rows;
  Batch batch{.jobs = jobs.size()};
  batch.workers = workers(args.jobs);
  batch.stop = stop;
  Progress progress(jobs.size(), "runs");
  batch.progress = [&](std::size_t done) { progress.say(done); };
  run_batch(
      batch,
      [&](std::size_t i) {
        const Job& job = jobs[i];
        scene::Scene s = scene_of(recordings.value()[job.recording], robots.value().panda, job.empty, args);
        s.planner = options[job.method];
        TrialOptions o;
        o.perfect_perception = false;
        o.velocities_known = !args.velocities_unknown;
        o.latency_s = args.latency_s;
        o.cycle = goals();
        o.stop = stop;
        return run_trial(s, o);
      },
      [&](std::size_t i, Trial t) {
        if (!stop()) rows.push_back({jobs[i], std::move(t)});
      });
  if (args.json)
    print_json(recordings.value(), names, rows);
  else
    print_rows(recordings.value(), names, rows);
  if (!args.csv_path.empty())
    if (const auto p = write_rows(args.csv_path, recordings.value(), names, rows))
      return runtime::complain("hamel bench", {*p});
  if (!stop()) return runtime::kDone;
  say_interrupted("runs");
  return runtime::kInterrupted;
}

}  // namespace hamel::client
