#include "clients/hamel/bench_tally.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamel::client {

namespace {

double quantile(std::vector<double> v, double part) {
  if (v.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = static_cast<std::size_t>(part * static_cast<double>(v.size() - 1) + 0.5);
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(at), v.end());
  return v[at];
}

template <class Get>
double of_reached(const std::vector<Figures>& all, double part, Get get) {
  std::vector<double> v;
  for (const Figures& f : all)
    if (f.ending == Ending::reached) v.push_back(get(f));
  return quantile(std::move(v), part);
}

template <class If>
std::uint64_t count(const std::vector<Figures>& all, If is) {
  return static_cast<std::uint64_t>(std::count_if(all.begin(), all.end(), is));
}

}  // namespace

Rate wilson(std::uint64_t hits, std::uint64_t of) noexcept {
  if (of == 0) return {};
  constexpr double z = 1.959963984540054;
  const double n = static_cast<double>(of), p = static_cast<double>(hits) / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return {p, hits == 0 ? 0 : middle - half, hits == of ? 1 : middle + half};
}

void Tally::add(std::size_t scene, const Trial& t) {
  all_.push_back({.scene = scene,
                  .ending = t.ending,
                  .time_s = t.time_s,
                  .path_m = t.path_m,
                  .clearance_m = t.clearance_min_m,
                  .error_m = t.error_m,
                  .end_s = t.end_s,
                  .jerkiness = t.jerkiness,
                  .arm_caused = t.contact && t.contact->arm_caused,
                  .self = t.contact && t.contact->self,
                  .reported = t.contact_reported,
                  .reason = t.reason,
                  .cycles = t.cycles,
                  .infeasible_cycles = t.infeasible_cycles,
                  .saturated_steps = t.saturated_steps,
                  .dropout = t.dropout});
  cycle_.add(t.cycle);
}

Rate Tally::rate(Ending ending) const noexcept {
  return wilson(count(all_, [&](const Figures& f) { return f.ending == ending; }), all_.size());
}
std::uint64_t Tally::caused_by_arm() const noexcept {
  return count(all_, [](const Figures& f) { return f.arm_caused; });
}
std::uint64_t Tally::unreported() const noexcept {
  return count(all_, [](const Figures& f) { return f.ending == Ending::collided && !f.reported; });
}
std::uint64_t Tally::infeasible() const noexcept {
  return count(all_, [](const Figures& f) { return f.infeasible_cycles > 0; });
}
double Tally::time_s(double part) const {
  return of_reached(all_, part, [](const Figures& f) { return f.time_s; });
}
double Tally::path_m(double part) const {
  return of_reached(all_, part, [](const Figures& f) { return f.path_m; });
}
double Tally::clearance_m(double part) const {
  return of_reached(all_, part, [](const Figures& f) { return f.clearance_m; });
}
double Tally::jerkiness() const {
  std::vector<double> v;
  for (const Figures& f : all_) v.push_back(f.jerkiness);
  return quantile(std::move(v), 0.5);
}

std::string label(const Cell& cell) {
  if (!cell.variant.empty()) return cell.family + ", " + cell.variant;
  return cell.spheres > 0 ? cell.family + " " + std::to_string(cell.spheres) : cell.family;
}

}  // namespace hamel::client
