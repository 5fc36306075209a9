#include "common/bus/backends.h"

namespace hamel::bus {

Result<std::unique_ptr<Node>, Problem> open_fastdds(const NodeOptions&) {
  return Problem{"bus", "fastdds is not in this build"};
}

}  // namespace hamel::bus
