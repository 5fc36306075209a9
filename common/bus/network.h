#pragma once
/// What both vendors need to know about this host's network before they start.  Private to common/bus.

#include <map>
#include <set>
#include <string>
#include <tuple>

#include "common/bus/bus.h"

namespace hamel::bus {

/// Participants on one host and domain take the indices 0..kMaxParticipantIndex; unicast discovery asks them
/// all.
inline constexpr int kMaxParticipantIndex = 49;

/// A participant that fell silent is gone after this; its peers hear from it several times within.
inline constexpr std::chrono::milliseconds kLease{3000}, kAnnouncement{800};

/// Instances of one topic that a reader keeps, so that a stranger cannot fill the memory with new keys.
inline constexpr int kMaxInstances = 64;

struct Interface {
  std::string name, address;  ///< IPv4, dotted
  bool loopback = false, multicast = false;
};

/// By name or IPv4 address; empty: the loopback.  Says so when there is none, it is down, or has no IPv4
/// address.
Result<Interface, Problem> find_interface(const std::string& name_or_address);

/// Every peer an IPv4 address?
Result<std::monostate, Problem> check_peers(const std::vector<std::string>& peers);

/// Where discovery is sent: the peers, then this host (other participants here).  Empty: by multicast.
std::vector<std::string> unicast_peers(const NodeOptions& options, const Interface& interface);

/// RTPS 9.6.1.1: where everybody is looked for, and the two unicast ports of a participant.
constexpr int multicast_port(std::uint32_t domain) { return 7400 + 250 * static_cast<int>(domain); }
constexpr int metatraffic_port(std::uint32_t domain, int index) {
  return multicast_port(domain) + 10 + 2 * index;
}
constexpr int user_port(std::uint32_t domain, int index) { return metatraffic_port(domain, index) + 1; }

/// The first participant index of `domain` whose ports nobody on this host has bound.
Result<int, Problem> free_participant_index(std::uint32_t domain);

/// The QoS a peer may disagree with, by its number in the DDS specification.
const char* policy_name(int id);

/// What writers promise to those that ask: to write at least once in `stale`, to say that they live.
inline constexpr std::chrono::milliseconds kAlive{1000};
/// What those that ask allow beyond it: on the wire a time is a binary fraction, rounded by each vendor its
/// way.
inline constexpr std::chrono::milliseconds kRounding{1};

/// Whether a reader has repeated what is lost on the way.
constexpr bool reliable(const Topic& topic, Ask ask) {
  return ask != Ask::glimpse || topic.delivery == Delivery::latched;
}

/// An end of ours and a peer cannot agree: kept by the vendor's thread, told by the owner's.
struct Disagreement {
  const Topic* topic = nullptr;
  bool we_write = false;
  Ask ask = Ask::data;
  int policy = 0;
  bool operator==(const Disagreement&) const = default;
};

/// Who cannot agree with us, told to a user once for each peer, topic and policy (or type).
class Complaints {
 public:
  /// One sentence for each peer among `known` that was not named before: which topic and policy, what it is
  /// on both sides, and whose.  Where nobody is known to differ: that a peer does.
  void tell(const Disagreement& d, Vendor vendor, const std::vector<Endpoint>& known,
            const std::function<void(const std::string&)>& log);
  /// A topic of ours.
  void watch(const Topic& topic) { types_[topic.name] = topic.type; }
  /// One sentence for each end among `known` that carries another type on a topic of ours.
  void look(Vendor vendor, const std::vector<Endpoint>& known,
            const std::function<void(const std::string&)>& log);
  const std::string& last() const { return last_; }

 private:
  static constexpr std::size_t kMost = 256;
  bool untold(std::string_view topic, bool we_write, int policy, const WriterId& peer) {
    return told_.size() < kMost && told_.emplace(topic, we_write, policy, peer).second;
  }
  std::set<std::tuple<std::string_view, bool, int, WriterId>> told_;
  std::map<std::string_view, std::string_view> types_;
  std::string last_;
};

/// What is wrong with a folder of an identity, or its files by the names of deploy/security/make.
struct Identity {
  std::string ca, certificate, key, governance, permissions_ca, permissions;  ///< absolute paths
};
Result<Identity, Problem> find_identity(const std::string& folder);

/// "10.0.0.1:11811" or "10.0.0.1" (port 11811).
struct Server {
  std::string address;
  int port = 11811;
};
Result<Server, Problem> parse_server(const std::string& text);

}  // namespace hamel::bus
