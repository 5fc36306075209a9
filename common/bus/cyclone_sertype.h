#pragma once
/// Cyclone DDS's view of a payload: bytes that pass through, with the key it needs.  Private to common/bus.
///
/// Written for the ddsi interface of Cyclone DDS 0.10, which is installed but not stable between versions.

#include <cstddef>
#include <span>

#include "dds/dds.h"
#include "dds/ddsi/ddsi_serdata.h"
#include "idl/topics.h"

namespace hamel::bus::cyclone {

/// A sample as Cyclone carries it: one block, the bytes behind this head.
struct Sample : ddsi_serdata {
  std::uint32_t key;
  std::uint32_t size;     ///< bytes that stand behind, a multiple of four
  std::uint32_t claimed;  ///< bytes that came; more than `size` where too large a sample was cut to its key

  std::byte* bytes() { return reinterpret_cast<std::byte*>(this + 1); }
  const std::byte* bytes() const { return reinterpret_cast<const std::byte*>(this + 1); }
  std::span<const std::byte> payload() const { return {bytes(), size}; }
};

/// A topic whose samples are `std::span<const std::byte>` on writing and Sample on taking (dds_takecdr);
/// negative on failure.
dds_entity_t create_topic(dds_entity_t participant, const Topic& topic);

}  // namespace hamel::bus::cyclone
