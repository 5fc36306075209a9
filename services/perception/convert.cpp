#include "services/perception/convert.h"

namespace hamel::perception {

bool to_wire(const Source& source, std::uint64_t k, std::uint64_t shown, bool promise,
             wire::ObstacleSet& out) {
  const double t_s = static_cast<double>(k) * source.period_s();
  out.sequence_number = k;
  out.t_s = t_s;
  out.next_t_s = promise ? source.next_time(t_s) : static_cast<double>(k + 1) * source.period_s();
  return source.at(static_cast<double>(shown) * source.period_s(), out.obstacles);
}

}  // namespace hamel::perception
