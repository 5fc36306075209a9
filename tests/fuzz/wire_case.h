#pragma once
/// One fuzz case of the wire: any bytes, as any message.

#include <cstdint>
#include <span>
#include <string>

#include "common/wire/fields.h"
#include "idl/topics.h"

namespace hamel::fuzz {

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
  if (!wire::encode(second, twice) || twice != again) return std::string(topic.name) + ": not the same twice";
  return "";
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
