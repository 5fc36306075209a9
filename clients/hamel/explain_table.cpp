#include "clients/hamel/explain_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/rbd/planar_chain.h"
#include "common/runtime/options.h"
#include "common/scene/reduce.h"

namespace hamel::client {

namespace {

constexpr int kRounds = 5;          // of timing, in turns; the fastest counts
constexpr double kRival = 1.3;      // settings that took up to so much longer than the chosen are timed again
constexpr double kNotSlower = 1.1;  // times the fastest other: what timing cannot tell apart

/// A way to run the scene, under the watch.
struct Row {
  scene::Scene scene;
  std::string name;
  Setting measured;
  bool meets = false;
};

scene::Scene as(const scene::Scene& written, scene::Fidelity fidelity) {
  scene::Scene s = written;
  s.reduce = {.fidelity = fidelity};
  scene::reduce(s);
  return s;
}

void print_row(const Row& r, double full_s, double other_s) {
  const scene::Scene& s = r.scene;
  const double cycle_ms = 1e3 * s.planner.period_steps * s.dynamics.dt_s;
  fmt::print(
      "| {} | {} | {} {:.4g} ms | {} | {} | {:.1e} | {:.1e} | {:.3g} | {:.2f} | {} | {:.4g} |\n", s.name,
      r.name, trade::label(s.dynamics), 1e3 * s.dynamics.dt_s,
      s.steered ? fmt::format("{:.4g} ms", cycle_ms) : "", space_of(s), r.measured.joint_error,
      r.measured.energy_error, 1e6 * r.measured.seconds_per_s, r.measured.seconds_per_s / full_s,
      other_s > 0 && std::isfinite(other_s) ? fmt::format("{:.2f}", r.measured.seconds_per_s / other_s) : "",
      1 / r.measured.seconds_per_s);
}

/// Full, default, chosen, then the others that keep to the accuracy in about the time of the chosen.
std::vector<Row> rows_of(const scene::Scene& written, const Choosing& c, const scene::Scene& fastest) {
  std::vector<Row> rows;
  rows.push_back({as(written, scene::Fidelity::full), "full", {}});
  rows.push_back({as(written, scene::Fidelity::exact), "exact (default)", {}});
  const Setting& chosen = *c.chosen;
  rows.push_back({with(fastest, chosen.dynamics, chosen.period_steps),
                  fmt::format("fastest within {:g}", written.accuracy.joint_error_rad),
                  {}});
  for (const Setting& t : c.tried) {
    const bool itself = overrides(t) == overrides(chosen);
    if (itself || !meets(written.accuracy, t, c.reference) || t.seconds_per_s > kRival * chosen.seconds_per_s)
      continue;
    rows.push_back({with(fastest, t.dynamics, t.period_steps), "", {}});
  }
  return rows;
}

/// The chosen setting keeps to the accuracy and nothing measured that does is faster.
bool print_rows(const scene::Scene& written, const trade::Watch& watch) {
  const scene::Scene fastest = as(written, scene::Fidelity::fastest);
  trade::Watch named = watch;
  named.tell = [&](const std::string& what) { watch.say(written.name + ": " + what); };
  const Choosing c = choose(fastest, named);
  watch.say("");
  if (!c.chosen) {
    fmt::print("| {} | none keeps to {:g}; reference known to {:.1e} | | | | | | | | | |\n", written.name,
               written.accuracy.joint_error_rad, c.reference.uncertainty);
    return false;
  }
  std::vector<Row> rows = rows_of(written, c, fastest);
  for (int round = 0; round < kRounds; ++round)
    for (Row& r : rows) {
      named.say("round " + std::to_string(round + 1) + " of timing");
      const Setting now = measure(r.scene, c.reference, watch);
      const double least_s =
          round == 0 ? now.seconds_per_s : std::min(r.measured.seconds_per_s, now.seconds_per_s);
      r.measured = now;
      r.measured.seconds_per_s = least_s;
      r.meets = meets(written.accuracy, now, c.reference);
    }
  watch.say("");
  double other_s = scene::kInf;
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (k != 2 && rows[k].meets) other_s = std::min(other_s, rows[k].measured.seconds_per_s);
  for (std::size_t k = 0; k < 3; ++k)
    print_row(rows[k], rows[0].measured.seconds_per_s, k == 2 ? other_s : 0);
  std::fflush(stdout);
  const bool kept = rows[2].meets && rows[2].measured.joint_error <= written.accuracy.joint_error_rad;
  const bool slower = rows[2].measured.seconds_per_s > kNotSlower * other_s;
  if (!kept) fmt::print(stderr, "{}: the chosen setting does not keep to the accuracy\n", written.name);
  if (slower)
    fmt::print(stderr, "{}: another measured setting keeps to the accuracy and is faster\n", written.name);
  return kept && !slower;
}

}  // namespace

const char* space_of(const scene::Scene& s) {
  return s.dynamics.space == scene::Space::automatic && rbd::is_planar(s.robot.chain) ? "SE2" : "SE3";
}

int print_table(const std::vector<scene::Scene>& scenes, const trade::Watch& watch) {
  fmt::print(
      "| scene | fidelity | tier, dt | planner each | space | joints off by | energy off by | us a simulated "
      "second | of "
      "full | of the fastest other within | real-time factor "
      "|\n|---|---|---|---|---|---:|---:|---:|---:|---:|---:|\n");
  bool all = true;
  for (const scene::Scene& s : scenes) all = print_rows(s, watch) && all;
  return all ? runtime::kDone : runtime::kFailed;
}

}  // namespace hamel::client
