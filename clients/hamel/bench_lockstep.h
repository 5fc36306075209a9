#pragma once
/// How fast lockstep goes over a bus: the services in two and in three processes, a run timed from within.

#include <cstdint>
#include <functional>
#include <string>

#include "common/bus/bus.h"

namespace hamel::client {

struct LockstepRate {
  int processes = 0;
  double step_us = 0;       ///< wall time of a step, mean of 20,000
  double tick_us = 0;       ///< of which the ticks themselves take, in one process without a bus
  double udp_round_us = 0;  ///< mean round trip of bare UDP, flat out, just before and just after
};

/// Two processes: dynamics, and planner with perception in this one.  Three: one each; this one hears the
/// run's clock (one message in ten steps) and nothing else.  `udp_round_us` measures the floor.  Throws
/// std::runtime_error where the run does not go on.
LockstepRate lockstep_rate(bus::Vendor vendor, std::uint32_t domain, const std::string& scene_path,
                           int processes, const std::function<double()>& udp_round_us);

}  // namespace hamel::client
