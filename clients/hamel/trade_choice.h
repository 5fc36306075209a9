#pragma once
/// Which of the measured runs are worth choosing.

#include <optional>
#include <vector>

#include "clients/hamel/trade_sweep.h"

namespace hamel::trade {

enum class Cost : std::uint8_t { time, evaluations };

double cost(const Measured& m, Cost by);
/// Marks the Pareto front of cost against joint error: finished runs that no other beats in one and equals in
/// the other.  An error below the reference's own uncertainty counts as that uncertainty.  Where the
/// reference holds nowhere, the front is that of cost against energy error.
void mark_front(std::vector<Measured>& all, const Reference& reference, Cost by);
/// What no joint is off by at any time of the horizon: twice what was found at the instants and the
/// reference's own uncertainty, for what lies between them, and what rounding adds up to [rad or m].
double error_bound(double joint_error, double uncertainty) noexcept;
/// True when a reference is sure enough to judge by: five times surer than the accuracy asked.
bool judges(double uncertainty, double accuracy) noexcept;
/// The cheapest finished run whose error_bound() is at most `accuracy`, or none.  Steps that had to be
/// divided disqualify, and so does a reference that does not hold over the whole horizon or does not judge.
std::optional<Measured> recommend(const std::vector<Measured>& all, const Reference& reference,
                                  double horizon_s, double accuracy, Cost by);

}  // namespace hamel::trade
