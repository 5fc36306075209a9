#pragma once
/// Trials counted: rates with their confidence intervals, medians.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/bench_families.h"
#include "clients/hamel/trial.h"

namespace hamel::client {

/// A rate and its 95 % interval by Wilson's score.  [Wilson 1927]
struct Rate {
  double value = 0, low = 0, high = 1;
};
Rate wilson(std::uint64_t hits, std::uint64_t of) noexcept;

/// What must be kept of one trial.
struct Figures {
  std::size_t scene = 0;
  Ending ending = Ending::failed;
  double time_s = 0, path_m = 0, clearance_m = 0, error_m = 0, end_s = 0, jerkiness = 0;
  bool arm_caused = false, self = false, reported = true;
  planner::Reason reason = planner::Reason::none;
  std::uint64_t cycles = 0, infeasible_cycles = 0, saturated_steps = 0;
  std::optional<Dropout> dropout = {};
};

/// All trials of one method in one cell.
class Tally {
 public:
  void add(std::size_t scene, const Trial& trial);

  std::uint64_t size() const noexcept { return all_.size(); }
  Rate rate(Ending ending) const noexcept;
  /// Of all contacts, those the arm caused, and those the planner did not report at once.
  std::uint64_t caused_by_arm() const noexcept;
  std::uint64_t unreported() const noexcept;
  /// Trials in which the planner once found no acceleration that keeps all distances.
  std::uint64_t infeasible() const noexcept;
  /// Among reached trials; NaN where there is none.  `part` 0.5: the median.
  double time_s(double part) const;
  double path_m(double part) const;
  double clearance_m(double part) const;
  /// Median over all trials of the total variation of qdd [rad/s^2 per s].
  double jerkiness() const;
  const Durations& cycle() const noexcept { return cycle_; }
  const std::vector<Figures>& all() const noexcept { return all_; }

 private:
  std::vector<Figures> all_;
  Durations cycle_;
};

/// The tallies of one cell, one for each method.
struct CellTally {
  Cell cell;
  std::vector<std::string> methods;
  std::vector<Tally> tallies;
};

/// "panda_static 16" or "example_5_2, damping 0.5, vmax 1".
std::string label(const Cell& cell);

}  // namespace hamel::client
