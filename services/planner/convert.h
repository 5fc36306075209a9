#pragma once
/// Between the planner's plain types and the wire: the only file of the service that sees both.

#include "common/wire/messages.h"
#include "services/planner/core/planner.h"

namespace hamel::planner {

scene::Goal from_wire(const wire::Goal& goal);
/// Fills everything of the report but keys, epoch, step, time, causes and wall times.
void to_wire(const Report& report, wire::PlannerReport& out);
wire::PlannerState to_wire(State state);

}  // namespace hamel::planner
