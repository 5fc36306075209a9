#pragma once
/// Between the perception core and the wire.

#include "common/wire/messages.h"
#include "services/perception/core/source.h"

namespace hamel::perception {

/// The set number `k` of a source seen at `rate_hz`: sample time k / rate_hz.  `last`: no set will follow by itself.
void to_wire(const Source& source, std::uint64_t k, double rate_hz, bool last, wire::ObstacleSet& out);

}  // namespace hamel::perception
