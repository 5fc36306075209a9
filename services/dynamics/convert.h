#pragma once
/// Between the arm's plain state and the wire: the only file of the service that sees both.

#include "common/wire/messages.h"
#include "services/dynamics/arm.h"

namespace hamel::dynamics {

/// Fills position to solver; keys, times and causes are the service's.
void to_wire(const Arm& arm, wire::ArmState& out);
void to_wire(const Arm& arm, wire::RunSummary& out);

}  // namespace hamel::dynamics
