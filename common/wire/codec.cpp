#include "common/wire/codec.h"

#include "common/wire/layout.h"

namespace hamel::wire {

template <class T>
bool encode(const T& m, bus::Payload& out) {
  cdr::Writer writer(out);
  layout(writer, m);
  return writer.finish(topic_of<T>().max_bytes);
}

template <class T>
Result<std::monostate, DecodeError> decode(std::span<const std::byte> payload, T& m) {
  if (payload.size() > topic_of<T>().max_bytes)
    return DecodeError{"payload", "must not be larger than its topic allows"};
  cdr::Reader reader(payload);
  layout(reader, m);
  reader.finish();
  if (!reader.ok()) return reader.error();
  return std::monostate{};
}

// The types of the wire and their topics; a type that is not here does not link.
#define HAMEL_WIRE_TYPE(T, topic)                \
  template <>                                    \
  const Topic& topic_of<T>() {                   \
    return topic;                                \
  }                                              \
  template bool encode(const T&, bus::Payload&); \
  template Result<std::monostate, DecodeError> decode(std::span<const std::byte>, T&);
HAMEL_WIRE_TYPE(ArmState, topics::kState)
HAMEL_WIRE_TYPE(TorqueCommand, topics::kCommand)
HAMEL_WIRE_TYPE(Goal, topics::kGoal)
HAMEL_WIRE_TYPE(ObstacleSet, topics::kObstacles)
HAMEL_WIRE_TYPE(PlannerReport, topics::kReport)
HAMEL_WIRE_TYPE(ModeCommand, topics::kMode)
HAMEL_WIRE_TYPE(ServiceStatus, topics::kStatus)
HAMEL_WIRE_TYPE(RobotDescription, topics::kRobot)
HAMEL_WIRE_TYPE(SimulationClock, topics::kClock)
HAMEL_WIRE_TYPE(RunSummary, topics::kSummary)
#undef HAMEL_WIRE_TYPE

const char* idl_hash() { return HAMEL_IDL_HASH; }

}  // namespace hamel::wire
