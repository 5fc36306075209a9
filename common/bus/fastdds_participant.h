#pragma once
/// How a Fast DDS participant goes to the network: transport, ports, peers, security.  Private to
/// common/bus.

#include <chrono>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include "common/bus/network.h"

namespace hamel::bus {

inline eprosima::fastrtps::Duration_t duration(std::chrono::milliseconds ms) {
  return eprosima::fastrtps::Duration_t(static_cast<long double>(ms.count()) * 1e-3L);
}

/// UDP alone, on `interface`, with the ports of participant `index` of this host.
eprosima::fastdds::dds::DomainParticipantQos participant_qos(const NodeOptions& options,
                                                             const Interface& interface, int index);

/// DDS Security by the files of an identity.
void secure(eprosima::fastdds::dds::DomainParticipantQos& qos, const Identity& identity);

/// A client of a discovery server of Fast DDS (its first, as `fast-discovery-server -i 0` is).
void use_server(eprosima::fastdds::dds::DomainParticipantQos& qos, const Server& server);

}  // namespace hamel::bus
