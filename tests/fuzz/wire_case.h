#pragma once
/// One fuzz case of the wire: any bytes, as any message.

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/wire/fields.h"
#include "idl/topics.h"

namespace hamel::fuzz {

/// The first field in which two messages differ by more than rounding: quaternions are made unit on the way
/// in.
inline std::string differ(const std::vector<wire::Field>& a, const std::vector<wire::Field>& b) {
  if (a.size() != b.size()) return "another number of fields";
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto *x = std::get_if<double>(&a[i].value), *y = std::get_if<double>(&b[i].value);
    const bool near = x != nullptr && y != nullptr && std::abs(*x - *y) <= 1e-12;
    if (!near && !wire::same(a[i], b[i])) return a[i].path + " differs";
  }
  return "";
}

/// What is broken, or nothing.  The law: bytes that decode, encode; what was encoded decodes to the same; the
/// tools' list of fields agrees with the decoder about what is a message.
template <class T>
std::string judge_message(std::span<const std::byte> payload) {
  const Topic& topic = wire::topic_of<T>();
  T first, second;
  const bool good = static_cast<bool>(wire::decode(payload, first));
  const auto listed = wire::fields(topic, payload);
  if (good != static_cast<bool>(listed)) return std::string(topic.name) + ": decode and fields disagree";
  wire::sample_time_s(topic, payload);
  if (!good) return "";
  bus::Payload again, twice;
  if (!wire::encode(first, again)) return std::string(topic.name) + ": decoded, but does not encode";
  if (!wire::decode<T>(again, second)) return std::string(topic.name) + ": encoded, but does not decode";
  if (!wire::encode(second, twice)) return std::string(topic.name) + ": does not encode twice";
  return differ(wire::fields(topic, again).value(), wire::fields(topic, twice).value());
}

/// The first byte chooses the message; the rest is its payload.
inline std::string judge_wire(std::span<const std::uint8_t> data) {
  if (data.empty()) return "";
  const auto payload = std::as_bytes(data.subspan(1));
  switch (data[0] % 10) {
    case 0:
      return judge_message<wire::ArmState>(payload);
    case 1:
      return judge_message<wire::TorqueCommand>(payload);
    case 2:
      return judge_message<wire::Goal>(payload);
    case 3:
      return judge_message<wire::ObstacleSet>(payload);
    case 4:
      return judge_message<wire::PlannerReport>(payload);
    case 5:
      return judge_message<wire::ModeCommand>(payload);
    case 6:
      return judge_message<wire::ServiceStatus>(payload);
    case 7:
      return judge_message<wire::RobotDescription>(payload);
    case 8:
      return judge_message<wire::SimulationClock>(payload);
    default:
      return judge_message<wire::RunSummary>(payload);
  }
}

}  // namespace hamel::fuzz
