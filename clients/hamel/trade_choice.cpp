#include "clients/hamel/trade_choice.h"

#include <algorithm>

namespace hamel::trade {

namespace {

constexpr double kBetween = 2;       // an error between two instants, of the largest at one
constexpr double kRounding = 1e-13;  // what a run adds up to [rad or m], at the least
constexpr double kSurer = 0.2;

}  // namespace

double cost(const Measured& m, Cost by) { return by == Cost::time ? m.seconds_per_s : m.evaluations_per_s; }

void mark_front(std::vector<Measured>& all, const Reference& reference, Cost by) {
  const bool compared = reference.valid_s > 0;
  const auto error = [&](const Measured& m) {
    return compared ? std::max(m.joint_error, reference.uncertainty) : m.energy_error;
  };
  const auto beats = [&](const Measured& a, const Measured& b) {
    return a.finished && cost(a, by) <= cost(b, by) && error(a) <= error(b) &&
           (cost(a, by) < cost(b, by) || error(a) < error(b));
  };
  for (Measured& m : all)
    m.on_front =
        m.finished && std::none_of(all.begin(), all.end(), [&](const Measured& o) { return beats(o, m); });
}

double error_bound(double joint_error, double uncertainty) noexcept {
  return kBetween * (joint_error + uncertainty) + kRounding;
}

bool judges(double uncertainty, double accuracy) noexcept { return uncertainty <= kSurer * accuracy; }

std::optional<Measured> recommend(const std::vector<Measured>& all, const Reference& reference,
                                  double horizon_s, double accuracy, Cost by) {
  if (reference.valid_s < horizon_s * (1 - 1e-9) || !judges(reference.uncertainty, accuracy))
    return std::nullopt;
  const Measured* best = nullptr;
  for (const Measured& m : all)
    if (m.finished && m.substepped == 0 && error_bound(m.joint_error, reference.uncertainty) <= accuracy &&
        (!best || cost(m, by) < cost(*best, by)))
      best = &m;
  return best ? std::optional(*best) : std::nullopt;
}

}  // namespace hamel::trade
