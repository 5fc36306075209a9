#include "common/bus/network.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <system_error>
#include <variant>

namespace hamel::bus {
namespace {

struct Candidate {
  Interface interface;
  bool up = false;
};

/// Every interface, those without an IPv4 address too, in the kernel's order; one entry for each address.
std::vector<Candidate> candidates() {
  std::vector<Candidate> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  for (const ifaddrs* i = list; i != nullptr; i = i->ifa_next) {
    const bool ipv4 = i->ifa_addr != nullptr && i->ifa_addr->sa_family == AF_INET;
    const bool link = i->ifa_addr == nullptr || i->ifa_addr->sa_family == AF_PACKET;
    if (!ipv4 && !link) continue;
    Candidate c;
    c.interface.name = i->ifa_name;
    c.interface.loopback = (i->ifa_flags & IFF_LOOPBACK) != 0;
    c.interface.multicast = (i->ifa_flags & IFF_MULTICAST) != 0;
    c.up = (i->ifa_flags & IFF_UP) != 0;
    char text[INET_ADDRSTRLEN] = "";
    if (ipv4)
      inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(i->ifa_addr)->sin_addr, text, sizeof text);
    c.interface.address = text;
    found.push_back(std::move(c));
  }
  freeifaddrs(list);
  return found;
}

std::string names_of(const std::vector<Candidate>& all) {
  std::string names;
  for (const Candidate& c : all) {
    if (c.interface.address.empty()) continue;
    names += (names.empty() ? "" : ", ") + c.interface.name + " (" + c.interface.address + ")";
  }
  return names.empty() ? "none" : names;
}

bool port_is_free(int port) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_ANY);
  const bool bound = bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(fd);
  return bound;
}

bool is_ipv4(const std::string& text) {
  in_addr parsed;
  return inet_pton(AF_INET, text.c_str(), &parsed) == 1;
}

}  // namespace

Result<Interface, Problem> find_interface(const std::string& name_or_address) {
  const auto all = candidates();
  const auto asked_for = [&](const Candidate& c) {
    if (name_or_address.empty()) return c.interface.loopback;
    return c.interface.name == name_or_address || c.interface.address == name_or_address;
  };
  const std::string asked = name_or_address.empty() ? "loopback" : name_or_address;
  bool exists = false, up = false;
  for (const Candidate& c : all) {
    if (!asked_for(c)) continue;
    exists = true;
    up = up || c.up;
    if (c.up && !c.interface.address.empty()) return c.interface;
  }
  if (!exists) return Problem{"interface", "= " + asked + ", does not exist; there are: " + names_of(all)};
  if (!up) return Problem{"interface", "= " + asked + ", is down"};
  return Problem{"interface", "= " + asked + ", has no IPv4 address"};
}

Result<std::monostate, Problem> check_peers(const std::vector<std::string>& peers) {
  for (const std::string& peer : peers)
    if (!is_ipv4(peer)) return Problem{"peers", "= " + peer + ", must be an IPv4 address"};
  return std::monostate{};
}

std::vector<std::string> unicast_peers(const NodeOptions& options, const Interface& interface) {
  if (options.peers.empty() && interface.multicast && !interface.loopback) return {};
  std::vector<std::string> peers = options.peers;
  if (std::find(peers.begin(), peers.end(), interface.address) == peers.end())
    peers.push_back(interface.address);
  return peers;
}

Result<int, Problem> free_participant_index(std::uint32_t domain) {
  for (int index = 0; index <= kMaxParticipantIndex; ++index)
    if (port_is_free(metatraffic_port(domain, index)) && port_is_free(user_port(domain, index))) return index;
  return Problem{"domain", "= " + std::to_string(domain) + ", has no free participant index: UDP ports " +
                               std::to_string(metatraffic_port(domain, 0)) + ".." +
                               std::to_string(user_port(domain, kMaxParticipantIndex)) +
                               " of this host are taken"};
}

const char* policy_name(int id) {
  static const std::map<int, const char*> names{
      {2, "durability"},     {3, "presentation"},        {4, "deadline"},
      {5, "latency budget"}, {6, "ownership"},           {8, "liveliness"},
      {10, "partition"},     {11, "reliability"},        {12, "destination order"},
      {13, "history"},       {23, "data representation"}};
  const auto name = names.find(id);
  return name == names.end() ? "an unnamed policy" : name->second;
}

namespace {

enum Policy { kDurability = 2, kDeadline = 4, kOwnership = 6, kLiveliness = 8, kReliability = 11 };

std::string text(std::chrono::microseconds t, const char* none) {
  if (t.count() == 0) return none;
  const auto us = t.count();
  return us % 1000 == 0 ? std::to_string(us / 1000) + " ms" : std::to_string(us) + " us";
}

/// What an end has of a policy.
std::string value(int policy, const Endpoint& e) {
  const std::string reliability = e.reliable ? "reliable" : "best-effort";
  const std::string durability = e.latched ? "transient-local" : "volatile";
  switch (policy) {
    case kDurability:
      return durability;
    case kDeadline:
      return text(e.deadline, "no deadline");
    case kOwnership:
      return e.exclusive ? "exclusive" : "shared";
    case kLiveliness:
      return text(e.liveliness, "no lease");
    case kReliability:
      return reliability;
    default:
      return reliability + ", " + durability;
  }
}

/// Where both ends are known, whether the writer offers less than the reader asks for.
bool differ(int policy, const Endpoint& writer, const Endpoint& reader) {
  const auto later = [](std::chrono::microseconds offered, std::chrono::microseconds asked) {
    return asked.count() > 0 && (offered.count() == 0 || offered > asked);
  };
  switch (policy) {
    case kDurability:
      return reader.latched && !writer.latched;
    case kDeadline:
      return later(writer.deadline, reader.deadline);
    case kOwnership:
      return reader.exclusive != writer.exclusive;
    case kLiveliness:
      return later(writer.liveliness, reader.liveliness);
    case kReliability:
      return reader.reliable && !writer.reliable;
    default:
      return false;
  }
}

Endpoint our_end(const Disagreement& d) {
  Endpoint e{.writes = d.we_write,
             .reliable = reliable(*d.topic, d.ask),
             .latched = d.topic->delivery == Delivery::latched};
  const auto more = d.we_write ? std::chrono::milliseconds(0) : kRounding;
  if (!d.we_write && d.ask != Ask::promises) return e;
  if (d.topic->rate_hz > 0) e.deadline = d.topic->stale + more;
  e.liveliness = kAlive + more;
  return e;
}

std::string whose(const Endpoint& e) {
  return (e.writes ? "the writer of " : "the reader of ") +
         (e.participant.empty() ? "an unnamed participant" : e.participant);
}

}  // namespace

void Complaints::look(Vendor vendor, const std::vector<Endpoint>& known,
                      const std::function<void(const std::string&)>& log) {
  constexpr int kType = 0;  // no policy's number
  for (const Endpoint& e : known) {
    const auto ours = types_.find(e.topic);
    if (ours == types_.end() || e.type == ours->second || !untold(ours->first, !e.writes, kType, e.id))
      continue;
    last_ = "topic " + e.topic + " (" + to_string(vendor) + "): " + whose(e) + " is of type " + e.type +
            ", ours is " + std::string(ours->second) + "; no data flows between the two";
    if (log) log(last_);
  }
}

void Complaints::tell(const Disagreement& d, Vendor vendor, const std::vector<Endpoint>& known,
                      const std::function<void(const std::string&)>& log) {
  const Endpoint ours = our_end(d);
  const auto say = [&](const WriterId& peer, const std::string& theirs) {
    if (!untold(d.topic->name, d.we_write, d.policy, peer)) return;
    last_ = "topic " + std::string(d.topic->name) + " (" + to_string(vendor) + "): QoS " +
            policy_name(d.policy) +
            " does not match: " + (d.we_write ? "our writer offers " : "our reader asks for ") +
            value(d.policy, ours) + ", " + theirs + "; no data flows between the two";
    if (log) log(last_);
  };
  bool named = false;
  for (const Endpoint& e : known) {
    if (e.topic != d.topic->name || e.writes == d.we_write) continue;
    if (!differ(d.policy, d.we_write ? ours : e, d.we_write ? e : ours)) continue;
    named = true;
    say(e.id, whose(e) + (d.we_write ? " asks for " : " offers ") + value(d.policy, e));
  }
  if (!named) say({}, d.we_write ? "a peer's reader asks for more" : "a peer's writer offers less");
}

Result<Identity, Problem> find_identity(const std::string& folder) {
  const std::filesystem::path at = std::filesystem::absolute(folder);
  Identity i;
  for (const auto& [file, name] :
       {std::pair{&i.ca, "ca.pem"}, std::pair{&i.certificate, "cert.pem"}, std::pair{&i.key, "key.pem"},
        std::pair{&i.governance, "governance.p7s"}, std::pair{&i.permissions_ca, "ca.pem"},
        std::pair{&i.permissions, "permissions.p7s"}}) {
    *file = (at / name).string();
    if (!std::filesystem::is_regular_file(*file))
      return Problem{"security", "= " + folder + ", has no " + name + "; deploy/security/make makes one"};
  }
  return i;
}

Result<Server, Problem> parse_server(const std::string& text) {
  Server s;
  const auto colon = text.find(':');
  s.address = text.substr(0, colon);
  bool good = is_ipv4(s.address);
  if (colon != std::string::npos) {
    const char *begin = text.data() + colon + 1, *end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(begin, end, s.port);
    good = good && error == std::errc() && rest == end && s.port > 0 && s.port < 65536;
  }
  if (good) return s;
  return Problem{"discovery server", "= " + text + ", must be an IPv4 address, or ADDRESS:PORT"};
}

}  // namespace hamel::bus
