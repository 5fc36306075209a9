#include "common/bus/backends.h"

namespace hamel::bus {

Result<std::unique_ptr<Node>, Problem> open_cyclonedds(const NodeOptions&) {
  return Problem{"bus", "cyclonedds is not in this build"};
}

}  // namespace hamel::bus
