#pragma once
/// Peers that know nothing of hamel but its IDL: made with the vendors' own API and generated types, on the
/// loopback.

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/topics.h"

namespace hamel::test {

/// A peer on one topic.  Its other end is the topic `kEcho`, of the same type.
class ForeignPeer {
 public:
  virtual ~ForeignPeer() = default;
  virtual bool matched() = 0;       ///< one reader of the topic, one writer of it and one reader of kEcho
  virtual bool write_golden() = 0;  ///< to the topic
  virtual bool echo() = 0;  ///< takes one sample of the topic and writes it to kEcho; false: none there
};

inline constexpr std::string_view kEcho = "hamel/v1/echo";

/// Plain programs of each vendor; null when the vendor refuses.  FastPeer on `domain` with fastddsgen's
/// types, CyclonePeer with idlc's.
std::unique_ptr<ForeignPeer> fast_peer(const Topic& topic, unsigned domain);
std::unique_ptr<ForeignPeer> cyclone_peer(const Topic& topic, unsigned domain);

/// The golden sample, and any payload decoded and encoded again, by fastddsgen's serialiser; empty on
/// failure.
std::vector<std::byte> fast_golden(const Topic& topic);
std::vector<std::byte> fast_again(const Topic& topic, std::span<const std::byte> payload);

}  // namespace hamel::test
