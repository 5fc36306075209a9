#include "common/runtime/presence.h"

#include <algorithm>
#include <utility>

#include "common/runtime/log.h"
#include "common/runtime/options.h"

namespace hamel::runtime {

namespace {
constexpr std::size_t kMostPeers = 256;
constexpr std::size_t kLongest = 255;  // of a detail, on the wire
}  // namespace

Presence::Presence(bus::Node& node, wire::ServiceKind kind, std::uint32_t arm)
    : node_(node), out_(node), in_(node) {
  status_.kind = kind;
  status_.arm = arm;
  status_.version = version();
  status_.idl_hash = wire::idl_hash();
  status_.bus = bus::to_string(node.options().vendor);
}

void Presence::hear(Clock::time_point now) {
  wire::ServiceStatus s;
  while (in_.take(s)) {
    const bus::WriterId from = in_.from();
    if (from == out_.id() || s.state == wire::ServiceState::stopping) continue;
    if (known_.size() >= kMostPeers && !known_.contains(from)) known_.clear();
    Peer& peer = known_[from];
    const std::string before = std::exchange(peer.version, s.version + s.idl_hash);
    peer.kind = s.kind, peer.arm = s.arm, peer.detail = s.detail, peer.heard = now;
    if (before == peer.version) continue;
    if (s.idl_hash != status_.idl_hash || s.version != status_.version) {
      strangers_ += s.idl_hash != status_.idl_hash;
      stranger_ =
          fmt::format("{} of arm {} is {} with IDL {}; this is {} with IDL {}: {}", wire::to_string(s.kind),
                      s.arm, s.version, s.idl_hash, status_.version, status_.idl_hash,
                      s.idl_hash != status_.idl_hash ? "they may not understand each other" : "same wire");
      spdlog::warn("{}", stranger_);
    }
    if (s.kind == status_.kind && s.arm == status_.arm) {
      ++doubles_;
      spdlog::warn("another {} of arm {} runs on this domain ({}, {})", wire::to_string(s.kind), s.arm, s.bus,
                   s.detail);
    }
  }
}

std::string Presence::word_of(wire::ServiceKind kind, std::uint32_t arm, Clock::time_point since) const {
  const Peer* newest = nullptr;
  for (const auto& [id, peer] : known_)
    if (peer.kind == kind && peer.arm == arm && peer.heard >= since &&
        (!newest || peer.heard > newest->heard))
      newest = &peer;
  return newest ? newest->detail : "";
}

void Presence::say(Clock::time_point now, Condition condition) {
  last_ = now;
  hear(now);
  status_.state = condition.state == wire::ServiceState::ready && strangers_ > 0
                      ? wire::ServiceState::degraded
                      : condition.state;
  status_.incarnation = condition.incarnation;
  status_.detail = std::move(condition.detail);
  for (const std::string& word : {stranger_, node_.complaint()})
    if (!word.empty()) status_.detail += "; " + word;
  status_.detail.resize(std::min(status_.detail.size(), kLongest));
  status_.counters = std::move(condition.counters);
  status_.counters.push_back({"peers_of_other_idl", strangers_});
  status_.counters.push_back({"peers_of_same_name", doubles_});
  status_.counters.push_back({"qos_incompatible", node_.incompatible()});
  out_.publish(status_);
}

}  // namespace hamel::runtime
