#pragma once
/// Fast DDS's own API, for tests that want a foreign peer.

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <cstdint>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <memory>

namespace hamel::test {

/// A participant that speaks UDP on 127.0.0.1 alone.
inline eprosima::fastdds::dds::DomainParticipant* loopback_participant(std::uint32_t domain) {
  namespace dds = eprosima::fastdds::dds;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  dds::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  eprosima::fastrtps::rtps::Locator_t here;
  eprosima::fastrtps::rtps::IPLocator::setIPv4(here, "127.0.0.1");
  qos.wire_protocol().builtin.initialPeersList.push_back(here);
  return dds::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

}  // namespace hamel::test
