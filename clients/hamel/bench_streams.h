#pragma once
/// The Panda in front of recorded obstacle streams: `hamel bench planner --streams`.

#include <functional>
#include <string>
#include <vector>

#include "clients/hamel/bench.h"
#include "common/base/result.h"
#include "common/scene/options.h"

namespace hamel::client {

/// Every *.csv of the folder, at recorded speed from its beginning to its end, and an empty scene of the same
/// length beside it: goals reached a minute, contacts by the arm and by others.
///
/// A stream stands as recorded, but moved along x until nobody comes nearer to the base's axis than 0.3 m.
/// The planner sees it as perception publishes it (30 Hz or more, extrapolated in between); the judge sees
/// where everything is at every step.
int bench_streams(const BenchArgs& args, const std::function<bool()>& stop);

// Shared with the other benches.
std::vector<std::string> assignments(const std::vector<std::string>& overrides, const std::string& method);
Problems choose_methods(const BenchArgs& args, std::vector<scene::Method>& methods,
                        std::vector<std::string>& names);

}  // namespace hamel::client
