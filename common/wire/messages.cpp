#include "common/wire/messages.h"

namespace hamel::wire {
namespace {

/// The name at the enum's place in `names`; an enum out of range has none.
template <class E, std::size_t N>
const char* name_of(E v, const char* const (&names)[N]) {
  const auto i = static_cast<std::size_t>(v);
  return i < N ? names[i] : "?";
}

}  // namespace

const char* to_string(PlannerState v) {
  return name_of(v, {"IDLE", "MOVING", "REACHED", "STUCK", "UNSAFE", "FAULT"});
}
const char* to_string(Reason v) {
  return name_of(v, {"none", "local_minimum", "joint_limit", "goal_blocked", "unreachable", "orbit",
                     "contact", "stale_obstacles", "stale_state", "infeasible", "non_finite", "torque_limit",
                     "driver", "configuration", "internal"});
}
const char* to_string(Validity v) {
  return name_of(v, {"valid", "command_stale", "holding", "stopped", "diverged"});
}
const char* to_string(Mode v) { return name_of(v, {"stop", "hold", "resume", "clear_fault"}); }
const char* to_string(ServiceKind v) {
  return name_of(v, {"unknown", "dynamics", "planner", "perception", "client"});
}
const char* to_string(ServiceState v) { return name_of(v, {"STARTING", "READY", "DEGRADED", "STOPPING"}); }

}  // namespace hamel::wire
