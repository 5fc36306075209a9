#include "services/perception/convert.h"

namespace hamel::perception {

void to_wire(const Source& source, std::uint64_t k, double rate_hz, bool last, wire::ObstacleSet& out) {
  out.sequence_number = k;
  out.t_s = static_cast<double>(k) / rate_hz;
  out.next_t_s = last ? wire::kInf : static_cast<double>(k + 1) / rate_hz;
  source.at(out.t_s, out.obstacles);
}

}  // namespace hamel::perception
