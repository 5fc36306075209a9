#include "clients/hamel/trade.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

#include "clients/hamel/batch.h"
#include "clients/hamel/gnuplot.h"
#include "clients/hamel/motion.h"
#include "clients/hamel/progress.h"
#include "clients/hamel/timing.h"
#include "clients/hamel/trade_choice.h"
#include "common/runtime/options.h"

namespace hamel::client {

namespace {

using trade::Measured;

std::string small(double v) { return std::isfinite(v) ? fmt::format("{:.1e}", v) : "-"; }

void print_reference(const scene::Scene& s, const trade::Motion& m, const trade::Reference& r) {
  fmt::print("{}: free motion of {} ({} joints) over {:.6g} s\n", s.name, s.robot.name, m.chain.n(),
             m.horizon_s);
  if (s.steered)
    fmt::print(
        "this scene is steered; measured is the arm left to itself from the same start: no planner, no\n"
        "obstacles, no compensation of gravity.  It may move faster or slower than when it is steered.\n");
  if (r.valid_s <= 0)
    fmt::print(
        "reference: none (valid up to 0 s): two runs of gauss-8 disagree within {:.6g} s; joints are not "
        "compared\n",
        m.horizon_s / trade::kSamples);
  else
    fmt::print(
        "reference: gauss-8, dt {:.6g} s; halving the step moves no joint by more than {:.1e} up to {:.6g} "
        "s\n",
        r.dt_s, r.uncertainty, r.valid_s);
  if (r.valid_s > 0 && r.valid_s < m.horizon_s * (1 - 1e-9))
    fmt::print("           beyond that nothing converges (chaotic motion): joint errors count up to there\n");
}

/// Up to when joints are compared, where the reference ends before the motion.
std::string joints_head(const trade::Motion& m, const trade::Reference& r) {
  const bool whole = r.valid_s >= m.horizon_s * (1 - 1e-9);
  return whole || r.valid_s <= 0 ? "joints" : fmt::format("joints to {:.4g} s", r.valid_s);
}

void print_table(const std::vector<Measured>& all, const trade::Motion& motion, const trade::Reference& r) {
  const std::string joints = joints_head(motion, r);
  const std::size_t wide = std::max<std::size_t>(10, joints.size());
  fmt::print("\n  {:<26}{:>10} {:>{}} {:>10} {:>10} {:>12} {:>10} {:>12} {:>8}\n", "method", "dt [s]", joints,
             wide, "energy", "momentum", "time [us/s]", "evals/s", "iterations", "divided");
  for (const Measured& m : all) {
    const std::string name = trade::label(m.options);
    if (!m.finished) {
      fmt::print("  {:<26}{:>10.4g} refused a step at t = {:.4g} s\n", name, m.options.dt_s, m.refused_s);
      continue;
    }
    fmt::print("{} {:<26}{:>10.4g} {:>{}} {:>10} {:>10} {:>12.1f} {:>10.0f} {:>7.1f}/{:<4} {:>8}\n",
               m.on_front ? '*' : ' ', name, m.options.dt_s, small(m.joint_error), wide,
               small(m.energy_error), small(m.momentum_error), 1e6 * m.seconds_per_s, m.evaluations_per_s,
               m.iterations_mean, m.iterations_max, m.substepped > 0 ? std::to_string(m.substepped) : "");
  }
  fmt::print(
      "\n* nothing measured is both cheaper and {}.  Errors: largest |q - reference| [rad or m]; "
      "|E - E0 - work| and momentum\n  about joint 1 relative to the largest in play.  Time: wall time of a "
      "simulated second.\n",
      r.valid_s > 0 ? "more accurate" : "keeps energy better");
}

/// Empty where there is no number.
std::string cell(double v) { return std::isnan(v) ? "" : fmt::format("{}", v); }

std::optional<Problem> write_csv(const std::string& path, const std::vector<Measured>& all,
                                 const trade::Reference& reference) {
  std::ofstream out(path);
  out << "method,tier,root,stages,dt_s,tolerance_Nm,tolerance_rel,finished,valid_s,joint_error,energy_error,"
         "momentum_error,time_s_per_s,evaluations_per_s,iterations_mean,iterations_max,divided_steps,front\n";
  for (const Measured& m : all)
    out << fmt::format("{},{},{},{},{},{},{},{:d},{},{},{},{},{},{},{},{},{},{:d}\n", trade::label(m.options),
                       scene::to_string(m.options.tier), scene::to_string(m.options.root), m.options.stages,
                       m.options.dt_s, m.options.tolerance_Nm, m.options.tolerance_rel, m.finished,
                       reference.valid_s, cell(m.joint_error), cell(m.energy_error), cell(m.momentum_error),
                       m.seconds_per_s, m.evaluations_per_s, m.iterations_mean, m.iterations_max,
                       m.substepped, m.on_front);
  out.flush();
  if (!out) return Problem{path, "cannot be written"};
  return std::nullopt;
}

/// Joint error, where joints were compared, and energy error against cost, a line for each method.
std::optional<Problem> draw_all(const std::string& path, const std::string& title,
                                const std::vector<Measured>& all, trade::Cost by, bool compared) {
  std::vector<std::pair<std::string, std::vector<const Measured*>>> groups;
  for (const Measured& m : all) {
    if (!m.finished || m.options.tolerance_Nm == 1e-6) continue;
    const std::string name = m.options.tier == scene::Tier::dopri8 ? "dopri8" : trade::label(m.options);
    const auto at =
        std::find_if(groups.begin(), groups.end(), [&](const auto& g) { return g.first == name; });
    (at == groups.end() ? groups.emplace_back(name, std::vector<const Measured*>{}) : *at)
        .second.push_back(&m);
  }
  const double scale = by == trade::Cost::time ? 1e6 : 1;
  Script s;
  s.add("{}", terminal(path, compared ? 1200 : 700, 560));
  for (std::size_t i = 0; i < groups.size(); ++i) {
    s.add("$g{} << EOD\n", i);
    for (const Measured* m : groups[i].second)
      s.add("{} {} {}\n", scale * trade::cost(*m, by), compared ? m->joint_error : 1,
            m->energy_error + 1e-17);
    s.add("EOD\n");
  }
  s.add("$front << EOD\n");
  for (const Measured& m : all)
    if (m.on_front)
      s.add("{} {}\n", scale * trade::cost(m, by), compared ? m.joint_error : m.energy_error + 1e-17);
  s.add(
      "EOD\nset multiplot layout 1,{} title \"{}\" noenhanced\nset logscale xy\nset format '1e%T'\nset "
      "grid\nset xlabel '{}'\n",
      compared ? 2 : 1, title,
      by == trade::Cost::time ? "time of a simulated second [us]" : "evaluations of a simulated second");
  for (const int column : {2, 3}) {
    if (column == 2 && !compared) continue;
    s.add("set key {}\nset ylabel '{}'\nplot ", column == 2 ? "off" : "outside right noenhanced",
          column == 2 ? "joint error [rad]" : "energy error / scale");
    for (std::size_t i = 0; i < groups.size(); ++i)
      s.add("$g{} using 1:{} with linespoints lw 1.5 lt {} title '{}'{}", i, column, i + 1, groups[i].first,
            i + 1 < groups.size() ? ", " : "");
    if ((column == 2) == compared) s.add(", $front using 1:2 with points pt 6 ps 1.6 lc rgb 'black' notitle");
    s.add("\n");
  }
  s.add("unset multiplot\n");
  return draw(s.str(), path);
}

int print_recommendation(const TradeArgs& args, const trade::Motion& m, const std::vector<Measured>& all,
                         const trade::Reference& r, trade::Cost by) {
  const auto best = trade::recommend(all, r, m.horizon_s, args.accuracy, by);
  if (!best) {
    fmt::print("\nNothing measured keeps every joint within {:g} over {:g} s without dividing steps",
               args.accuracy, m.horizon_s);
    fmt::print(
        "{}.\n",
        r.valid_s <= 0 ? ": there is no reference"
        : r.valid_s < m.horizon_s * (1 - 1e-9)
            ? fmt::format(": no method has an answer after {:.4g} s, where the reference ends", r.valid_s)
            : "");
    return runtime::kFailed;
  }
  const dynamics::Options& o = best->options;
  fmt::print("\nTo keep every joint within {:g} over {:g} s: {} with dt {:.6g} s\n", args.accuracy,
             m.horizon_s, trade::label(o), o.dt_s);
  fmt::print(
      "  measured: joints {:.1e} at {} instants, within {:.1e} at all times; energy {:.1e}, {:.1f} us and "
      "{:.0f} evaluations a simulated second\n",
      best->joint_error, trade::kSamples, trade::error_bound(best->joint_error, r.uncertainty),
      best->energy_error, 1e6 * best->seconds_per_s, best->evaluations_per_s);
  fmt::print("  --set dynamics.tier={} --set dynamics.dt_s={}", scene::to_string(o.tier), o.dt_s);
  if (o.tier == scene::Tier::gauss) fmt::print(" --set dynamics.stages={}", o.stages);
  if (o.tier == scene::Tier::dopri8) fmt::print(" --set dynamics.tolerance_rel={:g}", o.tolerance_rel);
  fmt::print(" --set dynamics.root={} --set dynamics.tolerance_Nm={:g}\n", scene::to_string(o.root),
             o.tolerance_Nm);
  return runtime::kDone;
}

/// Every measurement, or the first of them when told to end.  One after the other unless asked otherwise:
/// their times count.
std::vector<Measured> measure_all(const TradeArgs& args, const trade::Motion& motion,
                                  const trade::Reference& reference, const trade::Watch& watch) {
  std::vector<Measured> all;
  const auto candidates = trade::candidates(motion, args.quick);
  Progress progress(candidates.size(), "methods and steps");
  const Batch batch{
      .jobs = candidates.size(), .workers = args.jobs, .stop = watch.stop, .progress = [&](std::size_t k) {
        progress.say(k, trade::label(candidates[k - 1]));
      }};
  run_batch(
      batch, [&](std::size_t i) { return trade::measure(motion, candidates[i], reference, watch); },
      [&](std::size_t, Measured m) { all.push_back(std::move(m)); });
  return all;
}

int sweep(const TradeArgs& args, const scene::Scene& s, const runtime::StopSignal& stop) {
  const trade::Cost by = args.by == "time" ? trade::Cost::time : trade::Cost::evaluations;
  const trade::Motion motion{.chain = s.robot.chain,
                             .q0 = s.q0,
                             .qd0 = s.qd0,
                             .horizon_s = args.horizon_s > 0 ? args.horizon_s : s.duration_s,
                             .tick_s = args.tick_s > 0 ? args.tick_s : scene::kInf,
                             .base = s.dynamics};
  trade::Watch watch{now_s, [&] { return stop.requested(); }};
  const trade::Reference reference = [&] {
    Doing doing;
    watch.tell = [&](const std::string& what) { doing.say(what); };
    return trade::converge(motion, watch);
  }();
  watch.tell = {};
  std::vector<Measured> all = measure_all(args, motion, reference, watch);
  if (stop.requested()) return runtime::kInterrupted;
  trade::mark_front(all, reference, by);
  print_reference(s, motion, reference);
  print_table(all, motion, reference);
  const int code =
      args.accuracy > 0 ? print_recommendation(args, motion, all, reference, by) : runtime::kDone;
  if (!args.csv_path.empty())
    if (const auto p = write_csv(args.csv_path, all, reference))
      return runtime::complain("hamel trade", {*p});
  if (!args.plot_path.empty())
    if (const auto p = draw_all(args.plot_path, s.name, all, by, reference.valid_s > 0))
      return runtime::complain("hamel trade", {*p});
  return code;
}

}  // namespace

int trade(const TradeArgs& args) {
  if (!args.plot_path.empty())
    if (const auto p = check_picture_name(args.plot_path)) return runtime::complain("hamel trade", {*p});
  return on_motion(
      "hamel trade", args.scene_path, args.overrides,
      [&](const scene::Scene& s, const runtime::StopSignal& stop) { return sweep(args, s, stop); });
}

}  // namespace hamel::client
