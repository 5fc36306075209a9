#pragma once
/// Cyclone DDS's view of a payload: bytes that pass through, with the key it needs.  Private to common/bus.
///
/// Written for the ddsi interface of Cyclone DDS 0.10, which is installed but not stable between versions.

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>

#include "dds/dds.h"
#include "dds/ddsi/ddsi_serdata.h"
#include "idl/topics.h"

namespace hamel::bus::cyclone {

/// The keys of a type that Cyclone keeps instances of.  Where there are kMaxInstances, samples of others are
/// dropped as they come in, until an instance goes with its last writer.  (A limit among a reader's QoS would
/// not do: Cyclone's receiving thread waits for room, and all topics with it.)
class Keys {
 public:
  bool admits(std::uint32_t key);
  void add(std::uint32_t key);
  void remove(std::uint32_t key);
  std::uint64_t dropped() const { return dropped_; }

 private:
  std::mutex mutex_;
  std::unordered_map<std::uint32_t, int> instances_;
  std::atomic<std::uint64_t> dropped_{0};  ///< samples of keys too many
};

/// A sample as Cyclone carries it: one block, the bytes behind this head.  Without a type it stands for an
/// instance.
struct Sample : ddsi_serdata {
  std::shared_ptr<Keys> keys;
  std::uint32_t key;
  std::uint32_t size;     ///< bytes that stand behind, a multiple of four
  std::uint32_t claimed;  ///< bytes that came; more than `size` where too large a sample was cut to its key

  std::byte* bytes() { return reinterpret_cast<std::byte*>(this + 1); }
  const std::byte* bytes() const { return reinterpret_cast<const std::byte*>(this + 1); }
  std::span<const std::byte> payload() const { return {bytes(), size}; }
};

/// A topic whose samples are `std::span<const std::byte>` on writing and Sample on taking (dds_takecdr).
struct CycloneTopic {
  dds_entity_t entity = 0;  ///< negative on failure
  std::shared_ptr<const Keys> keys;
};
CycloneTopic create_topic(dds_entity_t participant, const Topic& topic);

}  // namespace hamel::bus::cyclone
