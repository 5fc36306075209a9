#pragma once
/// Plain messages to payloads and back.  codec.cpp is the only file that sees generated types.

#include <span>
#include <string>

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

/// Writes `m` as plain CDR (XCDR1, little endian, padding zeroed) into `out`, reusing its capacity.  False when a
/// size is over the IDL's bound; `out` is then empty.
template <class T>
bool encode(const T& m, bus::Payload& out);

/// Reads a payload into `m`.  Total: whatever the bytes are it returns, never throws, and allocates no more than
/// a small multiple of the payload.  `m` is unspecified but destructible on failure.
template <class T>
Result<std::monostate, DecodeError> decode(std::span<const std::byte> payload, T& m);

/// SHA-256 of idl/hamel_v1.idl as this program was built with it, the first 16 hexadecimal digits.
const char* idl_hash();

}  // namespace hamel::wire
