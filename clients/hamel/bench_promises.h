#pragma once
/// What `gyro` is promised to do on the bench's families: `hamel bench planner --assert`.

#include <string>
#include <vector>

#include "clients/hamel/bench_tally.h"

namespace hamel::client {

/// How the trials were made, where promises depend on it.
struct BenchConditions {
  double dt_s = 0.002;
  bool rollouts = true;  ///< gyro may ask for ways out
};

/// A sentence for each promise that the tallies of method gyro do not keep; empty: all kept.  Cells without a
/// promise, and cells that were not run, are passed over.
///
/// Reach is kept when the lower end of its 95 % interval is: few scenes show nothing.  Contacts, variation of
/// the accelerations and cycle times are judged by their value.
std::vector<std::string> missed_promises(const std::vector<CellTally>& all, const BenchConditions& made);

}  // namespace hamel::client
