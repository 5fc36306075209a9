#include "clients/hamel/batch_verb.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <map>

#include "clients/hamel/batch.h"
#include "clients/hamel/chosen.h"
#include "clients/hamel/journal.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/progress.h"
#include "clients/hamel/variations.h"
#include "common/base/hash.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/runtime/signals.h"

namespace hamel::client {

namespace {

/// What a batch came to, added up row by row: rows of an earlier run count from their text.
class Tally {
 public:
  void add(const std::string& row, std::size_t first_column) {
    std::vector<std::string> cell(1);
    bool quoted = false;
    for (const char c : row) {
      if (c == '"') quoted = !quoted;
      if (c == ',' && !quoted)
        cell.emplace_back();
      else if (c != '"')
        cell.back() += c;
    }
    const auto at = [&](std::size_t k) {
      return first_column + k < cell.size() ? cell[first_column + k] : std::string();
    };
    const std::string reason = at(1) == "none" ? "" : " (" + at(1) + ")";
    ++outcomes_[at(0) + reason];
    ++rows_;
    contacts_ += !at(5).empty() && at(5) != "0";
    note(time_, at(2));
    note(clearance_, at(4));
    note(path_, at(6));
  }

  void print() const {
    fmt::print("{} variations\n", rows_);
    for (const auto& [name, k] : outcomes_)
      fmt::print("  {:<34} {:>8} {:>7.1f} %\n", name, k,
                 100.0 * static_cast<double>(k) / static_cast<double>(rows_));
    fmt::print("  {:<34} {:>8}\n", "with contact", contacts_);
    fmt::print("  {:<34} {:>10} {:>10} {:>10}\n", "", "least", "median", "most");
    line("time to goal [s]", time_);
    line("min clearance [m]", clearance_);
    line("path length [m]", path_);
  }

 private:
  static void note(std::vector<double>& to, const std::string& cell) {
    if (!cell.empty()) to.push_back(std::strtod(cell.c_str(), nullptr));
  }
  static void line(const char* name, std::vector<double> v) {
    if (v.empty()) return;
    std::sort(v.begin(), v.end());
    fmt::print("  {:<34} {:>10.4g} {:>10.4g} {:>10.4g}\n", name, v.front(), v[v.size() / 2], v.back());
  }
  std::map<std::string, std::size_t> outcomes_;
  std::size_t rows_ = 0, contacts_ = 0;
  std::vector<double> time_, clearance_, path_;
};

std::string header(const Variations& v) {
  std::string out = "variation";
  for (const std::string& f : v.fields()) out += "," + f;
  return out + "," + result_header();
}

std::string row(const Variations& v, std::size_t i, const VariationResult& r) {
  std::string out = std::to_string(i);
  for (const std::string& x : v.values(i))
    out += x.find(',') == std::string::npos ? "," + x : ",\"" + x + "\"";
  return out + "," + to_csv(r);
}

/// Names the job: another scene, robot, stream, table or program begins anew.
std::string job_name(const scene::Scene& s, const Variations& v) {
  std::uint64_t h = scene::fingerprint(s);
  const auto add = [&h](const std::string& text) { h = hashed(text + '\n', h); };
  add(s.robot.spheres);
  if (s.perception.stream)
    for (const scene::StreamSample& x : s.perception.stream->samples)
      add(fmt::format("{} {} {} {} {} {} {} {}", x.t_s, x.id, x.p_m.x(), x.p_m.y(), x.p_m.z(),
                      x.shape.dims_m.x(), x.shape.dims_m.y(), x.shape.dims_m.z()));
  for (std::size_t i = 0; i < v.size(); ++i)
    for (const std::string& x : v.overrides(i)) add(x);
  return fmt::format("hamel batch of {}, {} variations, {:016x}, {}", s.name, v.size(), h,
                     runtime::version());
}

Checked<Variations> load_variations(const std::string& path) {
  if (path.ends_with(".csv")) return Variations::from_csv(path);
  auto text = files::load_batch(path);
  if (!text) return text.error();
  return Variations(std::move(text).value());
}

/// One variation as a row; a scene that is not valid ends the batch with its problems.
struct Done {
  std::string row;
  Problems problems;
};

Done run_one(const std::string& scene_path, const std::vector<std::string>& common, const Variations& v,
             std::size_t i) {
  std::vector<std::string> overrides = common;
  for (std::string& o : v.overrides(i)) overrides.push_back(std::move(o));
  const auto scene = load_chosen(scene_path, overrides);
  if (!scene) return {"", scene.error()};
  return {row(v, i, run_variation(scene.value())), {}};
}

int conclude(const Tally& tally, std::size_t done, std::size_t all, Journal* journal) {
  tally.print();
  if (done < all) {
    fmt::print(stderr, "interrupted after {} of {}{}\n", done, all,
               journal ? "; the same command goes on from there" : "");
    return runtime::kInterrupted;
  }
  if (journal)
    if (const auto p = journal->finish()) return runtime::complain("hamel batch", {*p});
  return runtime::kDone;
}

}  // namespace

int batch(const BatchArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  auto loaded = load_variations(args.path);
  if (!loaded) return runtime::complain("hamel batch", loaded.error());
  const Variations& v = loaded.value();
  runtime::RunOptions o;
  o.scene_path = args.scene_path.empty() ? v.scene_path() : args.scene_path;
  if (o.scene_path.empty())
    return runtime::complain("hamel batch", {{args.path, "names no scene; give one with --scene"}});
  o.overrides = v.set();
  o.overrides.insert(o.overrides.end(), args.overrides.begin(), args.overrides.end());
  for (const std::string& set : args.overrides)
    for (const std::string& field : v.fields())
      if (set.substr(0, set.find('=')) == field)
        return runtime::complain("hamel batch", {{"--set " + set, "varies in " + args.path}});
  if (const auto p = output_problem("-o", args.out_path, {args.path, o.scene_path}))
    return runtime::complain("hamel batch", {*p});
  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel batch", scene.error());

  std::unique_ptr<Journal> journal;
  Tally tally;
  std::size_t begun = 0;
  if (!args.out_path.empty()) {
    auto opened = Journal::open(args.out_path, job_name(scene.value(), v), header(v));
    if (!opened) return runtime::complain("hamel batch", {opened.error()});
    journal = std::move(opened).value();
    for (const std::string& kept : journal->kept()) tally.add(kept, 1 + v.fields().size());
    begun = std::min(journal->kept().size(), v.size());
    if (begun > 0) fmt::print(stderr, "going on after {} of {}\n", begun, v.size());
    if (journal->thrown_away() > 0)
      fmt::print(stderr, "{} rows of {}.partial were altered or do not follow on those before: done again\n",
                 journal->thrown_away(), args.out_path);
  }

  Problems problems;
  std::atomic<bool> failed{false};
  std::size_t done = begun;
  {
    Progress progress(v.size(), "variations");
    const Batch jobs{.jobs = v.size() - begun,
                     .workers = workers(args.workers),
                     .stop = [&] { return stop.requested() || failed; },
                     .progress = [&](std::size_t k) { progress.say(begun + k); }};
    run_batch(
        jobs, [&](std::size_t i) { return run_one(o.scene_path, o.overrides, v, begun + i); },
        [&](std::size_t, Done d) {
          if (failed) return;
          problems = d.problems;
          failed = !problems.empty() || (journal && !journal->add(d.row));
          if (failed) return;
          tally.add(d.row, 1 + v.fields().size());
          ++done;
        });
  }
  if (!problems.empty()) {
    problems.insert(problems.begin(), {args.path, fmt::format("variation {} is no valid scene", done)});
    return runtime::complain("hamel batch", problems);
  }
  if (failed) return runtime::complain("hamel batch", {{args.out_path, "cannot be written"}});
  return conclude(tally, done, v.size(), journal.get());
}

}  // namespace hamel::client
