#pragma once
/// Which of the measured runs are worth choosing.

#include <optional>
#include <vector>

#include "clients/hamel/trade_sweep.h"

namespace hamel::trade {

enum class Cost : std::uint8_t { time, evaluations };

double cost(const Measured& m, Cost by);
/// Marks the Pareto front of cost against joint error: finished runs that no other beats in one and equals in
/// the other.  An error below the reference's own uncertainty counts as that uncertainty.
void mark_front(std::vector<Measured>& all, const Reference& reference, Cost by);
/// The cheapest finished run whose joint error is at most `accuracy`, or none.  Steps that had to be divided
/// disqualify, and so does a reference that is not ten times surer than asked over the whole horizon.
std::optional<Measured> recommend(const std::vector<Measured>& all, const Reference& reference,
                                  double horizon_s, double accuracy, Cost by);

}  // namespace hamel::trade
