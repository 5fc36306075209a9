#pragma once
/// What every vendor's backend asks of a payload.  Private to common/bus.

#include <cstring>
#include <span>

#include "common/bus/bus.h"

namespace hamel::bus {

inline constexpr std::size_t kHeaderBytes = 4, kKeyBytes = 4;

inline bool little_endian(std::span<const std::byte> payload) { return payload[1] == std::byte{1}; }

/// Plain CDR of a size the topic allows, long enough to hold the key.
inline bool acceptable(std::span<const std::byte> payload, const Topic& topic) {
  const std::size_t least = kHeaderBytes + (topic.keyed ? kKeyBytes : 0);
  return payload.size() >= least && payload.size() <= topic.max_bytes && payload[0] == std::byte{0} &&
         payload[1] <= std::byte{1};
}

/// The key of an acceptable payload of a keyed topic: the first member, an unsigned long.
inline std::uint32_t key_of(std::span<const std::byte> payload) {
  std::uint32_t key = 0;
  for (std::size_t i = 0; i < kKeyBytes; ++i) {
    const std::size_t at = little_endian(payload) ? kKeyBytes - 1 - i : i;
    key = key << 8 | std::to_integer<std::uint32_t>(payload[kHeaderBytes + at]);
  }
  return key;
}

}  // namespace hamel::bus
