#pragma once
/// `hamel doctor`: what of this machine and network stands in the way, and the command that mends it.

#include "common/runtime/options.h"

namespace hamel::client {

struct DoctorArgs {
  runtime::BusOptions bus;
  bool json = false;
};

/// A line for each thing looked at.  1 where something is wrong, else 0.
int doctor(const DoctorArgs& args);

}  // namespace hamel::client
