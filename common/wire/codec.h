#pragma once
/// Plain messages to payloads and back.
///
/// One description of each message (layout.h) serves both directions over a small CDR of our own (cdr.h), so
/// that nothing here allocates per sample once warm, and no generated code stands between a stranger's bytes
/// and us. What fastddsgen and idlc generate from the IDL is the judge: tests compare the bytes.

#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "common/bus/bus.h"
#include "common/wire/messages.h"

namespace hamel::wire {

/// Why a payload is not a message: the field and the rule it breaks.  Points at string literals.
struct DecodeError {
  const char* field = "";
  const char* rule = "";
};

/// The topic a message travels on.
template <class T>
const Topic& topic_of();

/// Writes `m` as plain CDR (XCDR1, little endian, padding zeroed) into `out`, reusing its capacity.  False
/// when a size is over the IDL's bound, or a number or enum is one that decode() would refuse; `out` is then
/// empty.
template <class T>
bool encode(const T& m, bus::Payload& out);

/// Reads a payload into `m`.  Total: whatever the bytes are it returns, never throws, and allocates no more
/// than a small multiple of the payload.  `m` is unspecified but destructible on failure.
template <class T>
Result<std::monostate, DecodeError> decode(std::span<const std::byte> payload, T& m);

#define HAMEL_WIRE_TYPE(T)                              \
  template <>                                           \
  const Topic& topic_of<T>();                           \
  extern template bool encode(const T&, bus::Payload&); \
  extern template Result<std::monostate, DecodeError> decode(std::span<const std::byte>, T&);
HAMEL_WIRE_TYPE(ArmState)
HAMEL_WIRE_TYPE(TorqueCommand)
HAMEL_WIRE_TYPE(Goal)
HAMEL_WIRE_TYPE(ObstacleSet)
HAMEL_WIRE_TYPE(PlannerReport)
HAMEL_WIRE_TYPE(ModeCommand)
HAMEL_WIRE_TYPE(ServiceStatus)
HAMEL_WIRE_TYPE(RobotDescription)
HAMEL_WIRE_TYPE(SimulationClock)
HAMEL_WIRE_TYPE(RunSummary)
#undef HAMEL_WIRE_TYPE

/// SHA-256 of idl/hamel_v1.idl as this program was built with it, the first 16 hexadecimal digits.
const char* idl_hash();
/// That file's text.
std::string_view idl_text();

}  // namespace hamel::wire
