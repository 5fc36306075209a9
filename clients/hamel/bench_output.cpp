#include "clients/hamel/bench_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "clients/hamel/gnuplot.h"

namespace hamel::client {

namespace {

using nlohmann::json;

std::string percent(const Rate& r) {
  return fmt::format("{:5.1f} [{:4.1f},{:5.1f}]", 100 * r.value, 100 * r.low, 100 * r.high);
}

std::string number(double v, const char* format) {
  return std::isfinite(v) ? fmt::format(fmt::runtime(format), v) : "-";
}

json finite(double v) { return std::isfinite(v) ? json(v) : json(nullptr); }

json to_json(const Rate& r) { return {{"rate", r.value}, {"low", r.low}, {"high", r.high}}; }

json to_json(const std::string& method, const Tally& t) {
  json out{{"method", method}, {"trials", t.size()}};
  for (const Ending e : {Ending::reached, Ending::collided, Ending::stuck, Ending::timed_out, Ending::failed})
    out[to_string(e)] = to_json(t.rate(e));
  out["contacts_by_arm"] = t.caused_by_arm();
  out["contacts_unreported"] = t.unreported();
  out["infeasible_trials"] = t.infeasible();
  out["clearance_p5_m"] = finite(t.clearance_m(0.05));
  out["time_median_s"] = finite(t.time_s(0.5));
  out["path_median_m"] = finite(t.path_m(0.5));
  out["qdd_variation"] = finite(t.jerkiness());
  out["timing"] = {{"cycle_p50_us", finite(1e6 * t.cycle().quantile(0.5))},
                   {"cycle_p99_us", finite(1e6 * t.cycle().quantile(0.99))}};
  return out;
}

std::string columns(const std::optional<Dropout>& d) {
  return d ? fmt::format("{},{},{},{},{:d}", d->speed_radps, d->stale_speed_radps, d->stop_s, d->least_s,
                         d->told)
           : ",,,,";
}

}  // namespace

void print_table(const std::vector<CellTally>& all) {
  for (const CellTally& c : all) {
    fmt::print("\n{} ({} scenes)\n", label(c.cell), c.tallies.front().size());
    fmt::print("  {:<11}{:>20}{:>20} {:>6} {:>8} {:>7} {:>6} {:>7} {:>9} {:>7} {:>7} {:>7} {:>14}\n",
               "method", "reached % [95 %]", "contact % [95 %]", "by arm", "stuck %", "time %", "failed",
               "time s", "path m", "clear5", "infeas", "qdd TV", "cycle us 50/99");
    for (std::size_t k = 0; k < c.methods.size(); ++k) {
      const Tally& t = c.tallies[k];
      fmt::print(
          "  {:<11}{:>20}{:>20} {:>6} {:>8.1f} {:>7.1f} {:>6.1f} {:>7} {:>9} {:>7} {:>7} {:>7} {:>14}\n",
          c.methods[k], percent(t.rate(Ending::reached)), percent(t.rate(Ending::collided)),
          t.caused_by_arm(), 100 * t.rate(Ending::stuck).value, 100 * t.rate(Ending::timed_out).value,
          100 * t.rate(Ending::failed).value, number(t.time_s(0.5), "{:.2f}"),
          number(t.path_m(0.5), "{:.2f}"), number(t.clearance_m(0.05), "{:.4f}"), t.infeasible(),
          number(t.jerkiness(), "{:.0f}"),
          number(1e6 * t.cycle().quantile(0.5), "{:.1f}") + "/" +
              number(1e6 * t.cycle().quantile(0.99), "{:.1f}"));
      if (t.unreported() > 0)
        fmt::print("  {:<11}{} contacts were not reported by the planner at once\n", "", t.unreported());
    }
  }
  fmt::print(
      "\nReached: within tolerance and slow for the time asked.  Contact: first touch, judged by FCL on the "
      "full "
      "shapes, swept at <= 1 mm.\nBy arm: contacts the arm moved into.  Time, path: medians of those that "
      "reached; "
      "clear5: 5 % of those came nearer [m].\ninfeas: trials in which the barrier once had to brake.  qdd "
      "TV: "
      "median total variation of qdd [rad/s^2 a second].\n");
}

void print_dropouts(const std::vector<CellTally>& all) {
  constexpr double within_s = 0.1;
  fmt::print("\n{:<36}{:<11}{:>8}{:>10}{:>10}{:>12}{:>12}{:>12}{:>10}\n", "cell", "method", "moving",
             "contacts", "UNSAFE %", "in 0.1 s %", "longest ms", "least ms", "rad/s");
  for (const CellTally& c : all)
    for (std::size_t k = 0; k < c.methods.size(); ++k) {
      double moving = 0, told = 0, in_time = 0, fastest = 0;
      std::uint64_t contacts = 0;
      Dropout longest;
      for (const Figures& f : c.tallies[k].all()) {
        contacts += f.ending == Ending::collided;
        if (!f.dropout || f.dropout->speed_radps < kStill_radps || f.ending != Ending::timed_out) continue;
        const Dropout& d = *f.dropout;
        ++moving;
        told += d.told;
        in_time += d.stop_s <= within_s;
        if (d.stop_s > longest.stop_s) longest = d;
        fastest = std::max(fastest, d.stale_speed_radps);
      }
      fmt::print("{:<36}{:<11}{:>8.0f}{:>10}{:>10.1f}{:>12.1f}{:>12.0f}{:>12.0f}{:>10.2f}\n", label(c.cell),
                 c.methods[k], moving, contacts, 100 * told / moving, 100 * in_time / moving,
                 1e3 * longest.stop_s, 1e3 * longest.least_s, fastest);
    }
  fmt::print(
      "\nMoving: arms faster than 0.02 rad/s when the stream ended.  UNSAFE: told so, stale_obstacles, in "
      "every cycle from then on that it was stale.\nIn 0.1 s: every joint slower than 0.02 rad/s so soon "
      "after it was stale, and for good.  Least: what the torque limits allow at best in that\nlongest "
      "case.  rad/s: the fastest joint when it was stale.\n");
}

void say_interrupted(const char* things) {
  fmt::print(stderr, "interrupted: these are the {} that were done\n", things);
}

void print_json(const std::vector<CellTally>& all, const std::string& settings, bool interrupted) {
  json out;
  out["settings"] = json::parse(settings);
  out["interrupted"] = interrupted;
  out["cells"] = json::array();
  for (const CellTally& c : all) {
    json cell{{"family", c.cell.family}, {"spheres", c.cell.spheres}, {"variant", c.cell.variant}};
    for (std::size_t k = 0; k < c.methods.size(); ++k)
      cell["methods"].push_back(to_json(c.methods[k], c.tallies[k]));
    out["cells"].push_back(cell);
  }
  fmt::print("{}\n", out.dump(1));
}

std::optional<Problem> write_csv(const std::string& path, const std::vector<CellTally>& all) {
  std::ofstream out(path);
  out << "family,spheres,variant,scene,method,ending,end_s,time_s,path_m,clearance_min_m,error_m,contact_by_"
         "arm,"
         "contact_self,contact_reported,reason,cycles,infeasible_cycles,saturated_steps,qdd_variation,"
         "dropout_speed_radps,stale_speed_radps,stop_"
         "s,stop_least_s,told\n";
  for (const CellTally& c : all)
    for (std::size_t k = 0; k < c.methods.size(); ++k)
      for (const Figures& f : c.tallies[k].all())
        out << fmt::format("{},{},\"{}\",{},{},{},{},{},{},{},{},{:d},{:d},{:d},{},{},{},{},{},{}\n",
                           c.cell.family, c.cell.spheres, c.cell.variant, f.scene, c.methods[k],
                           to_string(f.ending), f.end_s, f.time_s, f.path_m, f.clearance_m, f.error_m,
                           f.arm_caused, f.self, f.reported, planner::to_string(f.reason), f.cycles,
                           f.infeasible_cycles, f.saturated_steps, f.jerkiness, columns(f.dropout));
  out.flush();
  if (!out) return Problem{path, "cannot be written"};
  return std::nullopt;
}

std::optional<Problem> draw_rates(const std::string& path, const std::string& title,
                                  const std::vector<CellTally>& all) {
  if (all.empty()) return Problem{path, "nothing to draw"};
  Script s;
  s.add("{}", terminal(path, 220 + 95 * static_cast<int>(all.size()), 720));
  const std::size_t methods = all.front().methods.size();
  const double width = 0.8 / static_cast<double>(methods);
  for (std::size_t k = 0; k < methods; ++k) {
    s.add("$m{} << EOD\n", k);
    for (std::size_t c = 0; c < all.size(); ++c) {
      const Rate r = all[c].tallies[k].rate(Ending::reached), x = all[c].tallies[k].rate(Ending::collided);
      s.add("{} {} {} {} {} {} {}\n", static_cast<double>(c) - 0.4 + width * (static_cast<double>(k) + 0.5),
            100 * r.value, 100 * r.low, 100 * r.high, 100 * x.value, 100 * x.low, 100 * x.high);
    }
    s.add("EOD\n");
  }
  s.add("set multiplot layout 2,1 title \"{}\" noenhanced\nset style fill solid 0.8\nset grid y\n", title);
  s.add(
      "set boxwidth {}\nset xrange [-0.6:{}]\nset key outside right noenhanced\nset xtics rotate by 20 right "
      "noenhanced font ',9' (",
      0.9 * width, static_cast<double>(all.size()) - 0.4);
  for (std::size_t c = 0; c < all.size(); ++c)
    s.add("'{}' {}{}", label(all[c].cell), c, c + 1 < all.size() ? ", " : ")\n");
  for (const int column : {2, 5}) {
    s.add("set ylabel '{}'\nset yrange [0:{}]\nplot ", column == 2 ? "reached [%]" : "first touch [%]",
          column == 2 ? "100" : "*");
    for (std::size_t k = 0; k < methods; ++k)
      s.add(
          "$m{0} using 1:{1} with boxes lt {2} title '{3}', $m{0} using 1:{1}:{4}:{5} with yerrorbars lt -1 "
          "pt 0 "
          "notitle{6}",
          k, column, k + 1, all.front().methods[k], column + 1, column + 2, k + 1 < methods ? ", " : "\n");
  }
  s.add("unset multiplot\n");
  return draw(s.str(), path);
}

}  // namespace hamel::client
