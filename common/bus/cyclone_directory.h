#pragma once
/// Who else is on a domain, as Cyclone DDS's built-in topics tell.  Private to common/bus.

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/bus/events.h"
#include "dds/dds.h"

namespace hamel::bus::cyclone {

/// The ends of other participants.  Its readers go with `participant`; on the owner's thread, but for the
/// news, which vendors' threads give to `inbound`.
class Directory {
 public:
  Directory(dds_entity_t participant, Inbound& inbound);
  /// Those whose participants are known, too.
  std::vector<Endpoint> others();

 private:
  std::map<WriterId, std::pair<WriterId, Endpoint>> ends_;  ///< with their participants
  std::map<WriterId, std::string> names_;                   ///< of participants, without our own
  const dds_entity_t writers_, readers_, participants_;     ///< readers of built-in topics; < 0: refused
  WriterId own_{};
};

}  // namespace hamel::bus::cyclone
