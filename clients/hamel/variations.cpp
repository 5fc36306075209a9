#include "clients/hamel/variations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "clients/hamel/ticks.h"
#include "common/base/random.h"
#include "common/base/text.h"
#include "common/files/scene_text.h"
#include "services/dynamics/trajectory_hash.h"

namespace hamel::client {

namespace {

/// In [0, 1): one number for each field of a variation, whatever was drawn before.
double uniform(std::uint64_t seed, std::size_t variation, std::size_t field) {
  const std::uint64_t of_variation = SplitMix64(SplitMix64(seed).next() ^ variation).next();
  return SplitMix64(of_variation ^ (field << 32)).unit();
}

/// What is wrong with the names of the fields that vary, or nothing.
std::string fault(const std::vector<std::string>& fields) {
  const auto printable = [](char c) { return c > ' ' && c <= '~'; };
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const std::string& name = fields[k];
    const std::string column = "column " + std::to_string(k + 1);
    if (name.empty() || !std::all_of(name.begin(), name.end(), printable))
      return column + " must name a field, such as planner.kp or q0[1]";
    if (std::find(fields.begin(), fields.begin() + static_cast<std::ptrdiff_t>(k), name) !=
        fields.begin() + static_cast<std::ptrdiff_t>(k))
      return column + ": " + name + " varies already";
  }
  return "";
}

/// Cells of one line: commas part them, except within brackets and quotes.
std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> out(1);
  int depth = 0;
  bool quoted = false;
  for (const char c : line) {
    if (c == '\r') continue;
    if (c == '"') {
      quoted = !quoted;
      continue;
    }
    if (!quoted) depth += (c == '[') - (c == ']');
    if (c == ',' && depth == 0 && !quoted)
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

std::string quoted(const std::string& cell) {
  return cell.find(',') == std::string::npos ? cell : std::string("\"").append(cell).append("\"");
}

std::string number(double v) { return std::isfinite(v) ? text(v) : ""; }

}  // namespace

Variations::Variations(files::BatchText t) : text_(std::move(t)), size_(text_.random) {
  for (const files::Vary& v : text_.vary) fields_.push_back(v.field);
  if (text_.random > 0) return;
  size_ = 1;
  for (const files::Vary& v : text_.vary) size_ *= v.values.empty() ? v.count : v.values.size();
}

Checked<Variations> Variations::from_csv(const std::string& path) {
  const auto text = files::read_file(path);
  if (!text) return text.error();
  Variations out;
  Problems found;
  const bool marked = text.value().starts_with("\xef\xbb\xbf");  // as some spreadsheets begin
  std::istringstream in(text.value().substr(marked ? 3 : 0));
  std::string line;
  for (std::size_t k = 1; std::getline(in, line); ++k) {
    if (line.empty() || line == "\r" || line.front() == '#') continue;
    std::vector<std::string> row = cells(line);
    if (out.fields_.empty()) {
      out.fields_ = std::move(row);
      if (const std::string why = fault(out.fields_); !why.empty())
        return Problems{{path + ":" + std::to_string(k), why}};
    } else if (row.size() == out.fields_.size()) {
      out.rows_.push_back(std::move(row));
    } else {
      found.push_back(
          {path + ":" + std::to_string(k),
           "has " + std::to_string(row.size()) + " cells, must have " + std::to_string(out.fields_.size())});
    }
    if (found.size() >= 20) break;
  }
  if (found.empty() && out.rows_.empty()) found.push_back({path, "has no variations"});
  if (!found.empty()) return found;
  out.size_ = out.rows_.size();
  return out;
}

std::vector<std::string> Variations::values(std::size_t i) const {
  if (!rows_.empty()) return rows_[i];
  std::vector<std::string> out(fields_.size());
  std::size_t rest = i;
  for (std::size_t k = fields_.size(); k-- > 0;) {
    const files::Vary& v = text_.vary[k];
    const std::size_t of = v.values.empty() ? v.count : v.values.size();
    const double u = text_.random > 0 ? uniform(text_.seed, i, k) : 0;
    const std::size_t at =
        text_.random > 0 ? static_cast<std::size_t>(u * static_cast<double>(of)) : rest % of;
    if (text_.random == 0) rest /= of;
    const double share = text_.random > 0 ? u : static_cast<double>(at) / static_cast<double>(of - 1);
    out[k] = v.values.empty() ? text(*v.from + share * (*v.to - *v.from)) : v.values[at];
  }
  return out;
}

std::vector<std::string> Variations::overrides(std::size_t i) const {
  std::vector<std::string> out = values(i);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = fields_[k] + "=" + out[k];
  return out;
}

VariationResult run_variation(const scene::Scene& scene) {
  Ticks ticks(scene);
  dynamics::TrajectoryHash hash;
  VariationResult r;
  r.clearance_m = scene::kInf;
  const auto note = [&] {
    const dynamics::State& s = ticks.arm().state();
    hash.add(s.step, s.q, s.p);
  };
  note();
  bool went = true;
  for (ticks.plan(); went && !ticks.done(); ticks.plan()) {
    went = ticks.step();
    if (went) note();
  }
  const planner::Report& report = ticks.report();
  r.outcome = !went ? "DIVERGED" : scene.steered ? planner::to_string(report.state) : "DONE";
  r.reason = scene.steered && went ? planner::to_string(report.reason) : "none";
  r.energy_drift_rel = ticks.arm().energy_drift_rel();
  r.steps = ticks.arm().state().step;
  r.hash = hash.hex();
  if (!scene.steered) return r;
  r.time_to_goal_s = report.time_to_goal_s;
  r.final_error_m = report.target_error_m;
  r.clearance_m = report.clearance_min_m;
  r.path_length_m = report.path_length_m;
  r.contacts = report.contacts;
  return r;
}

std::string result_header() {
  return "outcome,reason,time_to_goal_s,final_error_m,min_clearance_m,contacts,path_length_m,energy_drift_"
         "rel,"
         "steps,trajectory_hash";
}

std::string to_csv(const VariationResult& r) {
  return fmt::format("{},{},{},{},{},{},{},{},{},{}", r.outcome, quoted(r.reason),
                     r.time_to_goal_s < 0 ? "" : number(r.time_to_goal_s), number(r.final_error_m),
                     number(r.clearance_m), r.contacts, number(r.path_length_m), number(r.energy_drift_rel),
                     r.steps, r.hash);
}

}  // namespace hamel::client
