#pragma once
/// Who runs here: a service says so twice a second, and looks at what the others say.

#include <map>
#include <string>
#include <vector>

#include "common/runtime/loop.h"
#include "common/wire/endpoint.h"

namespace hamel::runtime {

/// What a service says about itself beside its name, version and bus.
struct Condition {
  wire::ServiceState state = wire::ServiceState::ready;
  std::uint64_t incarnation = 0;
  std::string detail;
  std::vector<wire::Counter> counters;
};

/// A peer of another version or IDL, and a second service of the same kind and arm, are named in one log line
/// each and counted in our own status, which then is DEGRADED where the IDL differs.  The last word about a
/// peer of another version or QoS stands in our status, too.
class Presence {
 public:
  Presence(bus::Node& node, wire::ServiceKind kind, std::uint32_t arm);
  bool due(Clock::time_point now) const { return now - last_ >= std::chrono::milliseconds(500); }
  /// Hears the others and says `condition`, with counters of its own added.
  void say(Clock::time_point now, Condition condition);

  /// The newest detail that a service of this kind and arm was heard to say at `since` or later; empty: none.
  std::string word_of(wire::ServiceKind kind, std::uint32_t arm, Clock::time_point since) const;

  std::uint64_t strangers() const { return strangers_; }  ///< peers of another IDL seen so far
  std::uint64_t doubles() const { return doubles_; }      ///< others of our kind and arm seen so far

 private:
  struct Peer {
    std::string version;  ///< and IDL, as said last
    wire::ServiceKind kind{};
    std::uint32_t arm = 0;
    std::string detail;
    Clock::time_point heard{};
  };
  void hear(Clock::time_point now);

  bus::Node& node_;
  wire::ServiceStatus status_;
  wire::Publisher<wire::ServiceStatus> out_;
  wire::Subscription<wire::ServiceStatus> in_;
  std::map<bus::WriterId, Peer> known_;
  std::uint64_t strangers_ = 0, doubles_ = 0;
  std::string stranger_;
  Clock::time_point last_{};
};

}  // namespace hamel::runtime
