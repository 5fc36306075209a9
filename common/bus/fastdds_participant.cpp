#include "common/bus/fastdds_participant.h"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <memory>
#include <random>

namespace hamel::bus {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

rtps::Locator_t locator(const std::string& address, int port) {
  rtps::Locator_t l;
  l.kind = LOCATOR_KIND_UDPv4;
  rtps::IPLocator::setIPv4(l, address);
  l.port = static_cast<std::uint32_t>(port);
  return l;
}

/// A prefix nobody had before, not even a process with our number on a host with our address (containers):
/// peers take a restarted process for a new one at once.  Bytes 0 and 1 name the vendor.
rtps::GuidPrefix_t random_prefix() {
  rtps::GuidPrefix_t prefix;
  std::random_device device;
  prefix.value[0] = 0x01, prefix.value[1] = 0x0f;
  for (unsigned i = 2; i < rtps::GuidPrefix_t::size; ++i)
    prefix.value[i] = static_cast<rtps::octet>(device());
  return prefix;
}

}  // namespace

void secure(dds::DomainParticipantQos& qos, const Identity& identity) {
  auto& properties = qos.properties().properties();
  const auto set = [&](const std::string& name, const std::string& value) {
    properties.emplace_back("dds.sec." + name, value);
  };
  const auto file = [&](const std::string& name, const std::string& path) { set(name, "file://" + path); };
  set("auth.plugin", "builtin.PKI-DH");
  file("auth.builtin.PKI-DH.identity_ca", identity.ca);
  file("auth.builtin.PKI-DH.identity_certificate", identity.certificate);
  file("auth.builtin.PKI-DH.private_key", identity.key);
  set("access.plugin", "builtin.Access-Permissions");
  file("access.builtin.Access-Permissions.permissions_ca", identity.permissions_ca);
  file("access.builtin.Access-Permissions.governance", identity.governance);
  file("access.builtin.Access-Permissions.permissions", identity.permissions);
  set("crypto.plugin", "builtin.AES-GCM-GMAC");
}

void use_server(dds::DomainParticipantQos& qos, const Server& server) {
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.discoveryProtocol = eprosima::fastrtps::rtps::DiscoveryProtocol_t::CLIENT;
  rtps::RemoteServerAttributes remote;
  remote.ReadguidPrefix("44.53.00.5f.45.50.52.4f.53.49.4d.41");
  remote.metatrafficUnicastLocatorList.push_back(locator(server.address, server.port));
  discovery.m_DiscoveryServers.push_back(remote);
}

dds::DomainParticipantQos participant_qos(const NodeOptions& options, const Interface& interface, int index) {
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {interface.address};
  udp->maxInitialPeersRange = kMaxParticipantIndex + 1;
  udp->receiveBufferSize = 4 << 20;  // the kernel cuts it to its own limit
  dds::DomainParticipantQos qos;
  qos.name(options.name);
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto& wire = qos.wire_protocol();
  wire.prefix = random_prefix();
  wire.builtin.discovery_config.leaseDuration = duration(kLease);
  wire.builtin.discovery_config.leaseDuration_announcementperiod = duration(kAnnouncement);
  // Ports by hand: Fast DDS's participant numbers are unique in a process, not in a domain.
  wire.builtin.metatrafficUnicastLocatorList.push_back(
      locator(interface.address, metatraffic_port(options.domain, index)));
  wire.default_unicast_locator_list.push_back(locator(interface.address, user_port(options.domain, index)));
  const auto peers = unicast_peers(options, interface);
  for (const std::string& peer : peers) wire.builtin.initialPeersList.push_back(locator(peer, 0));
  if (peers.empty())
    wire.builtin.metatrafficMulticastLocatorList.push_back(
        locator("239.255.0.1", multicast_port(options.domain)));
  return qos;
}

}  // namespace hamel::bus
