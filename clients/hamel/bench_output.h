#pragma once
/// What `hamel bench planner` writes: table, CSV, JSON, picture.

#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/bench_tally.h"
#include "common/base/result.h"

namespace hamel::client {

void print_table(const std::vector<CellTally>& all);
/// How arms stopped once the obstacle stream had ended, of those that moved then.
void print_dropouts(const std::vector<CellTally>& all);
void print_json(const std::vector<CellTally>& all, const std::string& settings, bool interrupted);
/// To standard error, behind what was done until then.
void say_interrupted(const char* things);
/// A line for each trial.
std::optional<Problem> write_csv(const std::string& path, const std::vector<CellTally>& all);
/// Rates of reaching and of collision, a group of bars for each cell.
std::optional<Problem> draw_rates(const std::string& path, const std::string& title,
                                  const std::vector<CellTally>& all);

}  // namespace hamel::client
