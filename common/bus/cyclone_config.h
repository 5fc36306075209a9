#pragma once
/// The configuration of Cyclone DDS as XML.  Private to common/bus.

#include "common/bus/network.h"

namespace hamel::bus::cyclone {

/// Whole, so that CYCLONEDDS_URI is not asked: a foreign setting must not move the arm's bus.  The folder of
/// an identity in `options` must have been checked by find_identity().
std::string configuration(const NodeOptions& options, const Interface& interface);

}  // namespace hamel::bus::cyclone
