#pragma once
/// Between the perception core and the wire.

#include "common/wire/messages.h"
#include "services/perception/core/source.h"

namespace hamel::perception {

/// Set number k, of sample time k period, which shows the source as it is at `shown` periods (k unless it was
/// paused).  `promise`: it names the time of its successor, +inf
/// when nothing will change any more; else the next period.  False inside a gap of the source, where nothing
/// is known.
bool to_wire(const Source& source, std::uint64_t k, std::uint64_t shown, bool promise,
             wire::ObstacleSet& out);

}  // namespace hamel::perception
