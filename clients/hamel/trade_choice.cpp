#include "clients/hamel/trade_choice.h"

#include <algorithm>

namespace hamel::trade {

double cost(const Measured& m, Cost by) { return by == Cost::time ? m.seconds_per_s : m.evaluations_per_s; }

void mark_front(std::vector<Measured>& all, const Reference& reference, Cost by) {
  const auto error = [&](const Measured& m) { return std::max(m.joint_error, reference.uncertainty); };
  const auto beats = [&](const Measured& a, const Measured& b) {
    return a.finished && cost(a, by) <= cost(b, by) && error(a) <= error(b) &&
           (cost(a, by) < cost(b, by) || error(a) < error(b));
  };
  for (Measured& m : all)
    m.on_front =
        m.finished && std::none_of(all.begin(), all.end(), [&](const Measured& o) { return beats(o, m); });
}

std::optional<Measured> recommend(const std::vector<Measured>& all, const Reference& reference,
                                  double horizon_s, double accuracy, Cost by) {
  if (reference.valid_s < horizon_s * (1 - 1e-9) || reference.uncertainty > 0.1 * accuracy)
    return std::nullopt;
  const Measured* best = nullptr;
  for (const Measured& m : all)
    if (m.finished && m.substepped == 0 && m.joint_error <= accuracy &&
        (!best || cost(m, by) < cost(*best, by)))
      best = &m;
  return best ? std::optional(*best) : std::nullopt;
}

}  // namespace hamel::trade
