#pragma once
/// The vendors behind bus::open().  Private to common/bus.

#include "common/bus/bus.h"

namespace hamel::bus {

Result<std::unique_ptr<Node>, Problem> open_inproc(const NodeOptions& options);
Result<std::unique_ptr<Node>, Problem> open_fastdds(const NodeOptions& options);
Result<std::unique_ptr<Node>, Problem> open_cyclonedds(const NodeOptions& options);

std::string fastdds_version();
std::string cyclonedds_version();

}  // namespace hamel::bus
