/// The bus over Fast DDS: UDP only, bytes pass through, listeners only notify.
///
/// Fast DDS's threads call the listeners; those live until the participant is gone, so that a callback still
/// on its way when a reader or writer leaves finds them in place.

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/config.h>
#include <fastrtps/utils/IPLocator.h>
#include <algorithm>
#include <atomic>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <stdexcept>
#include <variant>

#include "common/bus/backends.h"
#include "common/bus/fastdds_events.h"
#include "common/bus/fastdds_type.h"
#include "common/bus/network.h"

namespace hamel::bus {
namespace {

using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

Duration_t duration(std::chrono::milliseconds ms) {
  return Duration_t(static_cast<long double>(ms.count()) * 1e-3L);
}

/// A late Cyclone reader waits for the writer's next heartbeat, and so does what was lost on the way: it must
/// be repeated before a command is stale.  Fast DDS's default is 3 s.
constexpr std::chrono::milliseconds kHeartbeat{10};

/// The part of QoS that writers and readers share.
template <class Qos>
Qos common_qos(const Topic& topic, int depth) {
  const bool latched = topic.delivery == Delivery::latched;
  Qos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.resource_limits().max_instances = 0;  // as many as we name ourselves
  qos.resource_limits().max_samples_per_instance = qos.history().depth;
  qos.resource_limits().max_samples = 0;
  qos.resource_limits().allocated_samples = latched ? 4 : 32;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
  return qos;
}

/// The promises of a topic's writers, offered by each, asked for by some readers.
template <class Qos>
void promise(Qos& qos, const Topic& topic, std::chrono::milliseconds more = {}) {
  if (topic.rate_hz > 0) qos.deadline().period = duration(topic.stale + more);
  qos.liveliness().kind = dds::AUTOMATIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = duration(kAlive + more);
  qos.liveliness().announcement_period = duration(kAlive / 3);
}

/// Instances that Fast DDS is let keep, of which a reader hears kMaxInstances.  Where there are no more to be
/// had, 2.9 makes room by dropping one of which nothing waits, and ends the program (an assertion of its own)
/// when a sample of that one is on its way: so many that no peer comes there by mistake, and what a hostile
/// one can fill with them is tens of megabytes.
constexpr int kVendorInstances = 1 << 16;

dds::DataReaderQos reader_qos(const Topic& topic, int depth, Ask ask) {
  auto qos = common_qos<dds::DataReaderQos>(topic, depth > 0 ? depth : depth_of(topic.delivery));
  qos.resource_limits().max_instances = kVendorInstances;
  qos.resource_limits().max_samples = kVendorInstances * qos.history().depth;
  if (ask == Ask::promises) promise(qos, topic, kRounding);
  return qos;
}

dds::DataWriterQos writer_qos(const Topic& topic) {
  auto qos = common_qos<dds::DataWriterQos>(topic, depth_of(topic.delivery));
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = duration(kHeartbeat);
  promise(qos, topic);
  qos.writer_data_lifecycle().autodispose_unregistered_instances = false;
  return qos;
}

class FastWriter final : public Writer {
 public:
  FastWriter(const Topic& topic, dds::Publisher& publisher, dds::DataWriter& writer, WriterEvents& events)
      : topic_(topic), publisher_(publisher), writer_(writer), events_(events) {}
  ~FastWriter() override {
    writer_.set_listener(nullptr);
    publisher_.delete_datawriter(&writer_);
  }

  bool write(std::span<const std::byte> payload) override {
    RawSample sample{payload, nullptr, payload.size()};
    const bool sent = acceptable(payload, topic_) && writer_.write(&sample);
    ++(sent ? samples_ : refused_);
    return sent;
  }
  bool dispose(std::span<const std::byte> payload) override {
    if (!acceptable(payload, topic_)) return false;
    RawSample sample{payload, nullptr, payload.size()};
    return writer_.dispose(&sample, dds::HANDLE_NIL) == ReturnCode_t::RETCODE_OK;
  }
  WriterId id() const override { return id_of(writer_.guid()); }
  int matched() const override { return events_.matched; }
  Counters counters() const override { return events_.counters(samples_, refused_); }

 private:
  const Topic& topic_;
  dds::Publisher& publisher_;
  dds::DataWriter& writer_;
  WriterEvents& events_;
  std::uint64_t samples_ = 0, refused_ = 0;
};

class FastReader final : public Reader {
 public:
  FastReader(const Topic& topic, dds::Subscriber& subscriber, dds::DataReader& reader, ReaderEvents& events,
             const Neighbours& neighbours)
      : topic_(topic), subscriber_(subscriber), reader_(reader), events_(events), neighbours_(neighbours) {}
  ~FastReader() override {
    reader_.set_listener(nullptr);
    subscriber_.delete_datareader(&reader_);
  }

  bool take(Payload& payload) override {
    if (!events_.waits.exchange(false)) return false;
    RawSample sample{{}, &payload, 0};
    dds::SampleInfo info;
    for (int i = 0; i < kPassedOver; ++i) {
      if (reader_.take_next_sample(&sample, &info) != ReturnCode_t::RETCODE_OK) return false;
      if (!info.valid_data) {  // an instance's state changed
        ++disposed_;
        continue;
      }
      from_ = info.sample_identity.writer_guid();
      if (topic_.keyed && !hears(info.instance_handle)) {
        ++passed_over_;
        continue;
      }
      const bool good = sample.size == payload.size() && acceptable(payload, topic_);
      ++(good ? samples_ : refused_);
      if (!good) continue;
      events_.waits = true;  // more, perhaps
      return true;
    }
    events_.arrived();
    return false;
  }
  WriterId from() const override { return id_of(from_); }
  int matched() const override { return events_.matched; }
  Counters counters() const override {
    Counters c = events_.counters(samples_, refused_, disposed_);
    c.lost += passed_over_;
    return c;
  }

 private:
  /// Keys are heard as they come, up to kMaxInstances.  They make room when their writers have gone, which is
  /// looked at once for so many samples that are passed over: Fast DDS says nothing of an instance of which
  /// nothing waits.
  bool hears(const dds::InstanceHandle_t& key) {
    if (const auto known = heard_.find(key); known != heard_.end()) {
      known->second = from_;
      return true;
    }
    if (heard_.size() >= kMaxInstances && passed_over_ % kMaxInstances == 0)
      std::erase_if(heard_, [this](const auto& k) { return !neighbours_.know(k.second); });
    return heard_.size() < kMaxInstances && heard_.emplace(key, from_).second;
  }

  const Topic& topic_;
  dds::Subscriber& subscriber_;
  dds::DataReader& reader_;
  ReaderEvents& events_;
  const Neighbours& neighbours_;
  rtps::GUID_t from_;
  std::map<dds::InstanceHandle_t, rtps::GUID_t> heard_;  ///< and who wrote each last
  std::uint64_t samples_ = 0, refused_ = 0, disposed_ = 0, passed_over_ = 0;
};

template <class T>
T& checked(T* made, const char* what, const Topic& topic) {
  if (made == nullptr)
    throw std::runtime_error("Fast DDS refused to create a " + std::string(what) + " for topic " +
                             std::string(topic.name));
  return *made;
}

/// Fast DDS numbers the participants of a process, upwards for ever if left to itself, and ends the program
/// (exit) when a number gives a port over 65535.  So each takes the lowest number that is free in this
/// process.
class ParticipantNumber {
 public:
  ParticipantNumber() {
    std::lock_guard lock(mutex());
    while (!taken().insert(number_).second) ++number_;
  }
  ~ParticipantNumber() {
    std::lock_guard lock(mutex());
    taken().erase(number_);
  }
  ParticipantNumber(const ParticipantNumber&) = delete;
  ParticipantNumber& operator=(const ParticipantNumber&) = delete;
  int get() const { return number_; }

 private:
  static std::mutex& mutex() {
    static std::mutex m;
    return m;
  }
  static std::set<int>& taken() {
    static std::set<int> s;
    return s;
  }
  int number_ = 0;
};

class FastNode final : public Node {
 public:
  explicit FastNode(const NodeOptions& options) : options_(options) {}
  ~FastNode() override {
    if (participant_ == nullptr) return;
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  /// False when Fast DDS refuses.
  bool start(dds::DomainParticipantQos qos) {
    qos.wire_protocol().participant_id = number_.get();
    auto* factory = dds::DomainParticipantFactory::get_instance();
    participant_ = factory->create_participant(options_.domain, qos, &neighbours_, dds::StatusMask::none());
    if (participant_ == nullptr) return false;
    publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
    return started();
  }
  bool started() const { return publisher_ != nullptr && subscriber_ != nullptr; }

  std::unique_ptr<Writer> writer(const Topic& topic) override {
    auto& events = keep(writer_events_, std::make_unique<WriterEvents>(topic, inbound_, true, Ask::data));
    auto& made = checked(publisher_->create_datawriter(&topic_for(topic), writer_qos(topic), &events),
                         "writer", topic);
    return std::make_unique<FastWriter>(topic, *publisher_, made, events);
  }

  std::unique_ptr<Reader> reader(const Topic& topic, int depth, Ask ask) override {
    auto& events = keep(reader_events_, std::make_unique<ReaderEvents>(topic, inbound_, false, ask));
    auto& made =
        checked(subscriber_->create_datareader(&topic_for(topic), reader_qos(topic, depth, ask), &events),
                "reader", topic);
    return std::make_unique<FastReader>(topic, *subscriber_, made, events, neighbours_);
  }

  std::vector<Endpoint> endpoints() override { return neighbours_.all(); }
  std::uint64_t incompatible() const override { return inbound_.incompatible(); }
  std::string complaint() const override { return complaints_.last(); }
  bool wait(std::chrono::steady_clock::time_point deadline) override {
    // Fast DDS's receiving threads wait for its locks: they are faster where the owner sleeps.
    return inbound_.wait(
        deadline, {},
        [this](const Disagreement& d) { complaints_.tell(d, Vendor::fastdds, endpoints(), options_.log); },
        [this] { complaints_.look(Vendor::fastdds, endpoints(), options_.log); });
  }
  void wake() noexcept override { inbound_.notifier.notify(); }
  const NodeOptions& options() const override { return options_; }

 private:
  template <class T>
  static T& keep(std::vector<std::unique_ptr<T>>& all, std::unique_ptr<T> one) {
    all.push_back(std::move(one));
    return *all.back();
  }

  dds::Topic& topic_for(const Topic& topic) {
    dds::Topic*& made = topics_[topic.name];
    if (made == nullptr) {
      const dds::TypeSupport type(new PassThroughType(topic));
      type.register_type(participant_);
      made =
          participant_->create_topic(std::string(topic.name), type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
      complaints_.watch(topic);
      inbound_.ends_changed();
    }
    return checked(made, "topic", topic);
  }

  const NodeOptions options_;
  const ParticipantNumber number_;
  Inbound inbound_;
  Complaints complaints_;
  Neighbours neighbours_{inbound_};
  std::vector<std::unique_ptr<WriterEvents>> writer_events_;  // until the participant is gone
  std::vector<std::unique_ptr<ReaderEvents>> reader_events_;
  std::map<std::string_view, dds::Topic*> topics_;
  dds::DomainParticipant* participant_ = nullptr;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
};

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

/// DDS Security by the files of an identity.
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

/// A client of a discovery server of Fast DDS (its first, as `fast-discovery-server -i 0` is).
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

}  // namespace

std::string fastdds_version() { return FASTRTPS_VERSION_STR; }

Result<std::unique_ptr<Node>, Problem> open_fastdds(const NodeOptions& options) {
  const auto interface = find_interface(options.interface_name);
  if (!interface) return interface.error();
  if (const auto peers = check_peers(options.peers); !peers) return peers.error();
  const auto index = free_participant_index(options.domain);
  if (!index) return index.error();
  auto qos = participant_qos(options, interface.value(), index.value());
  if (!options.discovery_server.empty()) {
    const auto server = parse_server(options.discovery_server);
    if (!server) return server.error();
    use_server(qos, server.value());
  }
  if (!options.security.empty()) {
    const auto identity = find_identity(options.security);
    if (!identity) return identity.error();
    secure(qos, identity.value());
  }
  auto node = std::make_unique<FastNode>(options);
  if (!node->start(qos) && !options.security.empty())
    return Problem{"security", "= " + options.security +
                                   ", Fast DDS refuses it: expired, of another CA, or "
                                   "its subject is not the one in the permissions"};
  if (!node->started())
    return Problem{"domain", "= " + std::to_string(options.domain) + ", Fast DDS refuses to join it on " +
                                 interface.value().address};
  return std::unique_ptr<Node>(std::move(node));
}

}  // namespace hamel::bus
