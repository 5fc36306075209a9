/// The bus over Fast DDS: UDP only, bytes pass through, listeners only notify.
///
/// Fast DDS's threads call the listeners; those live until the participant is gone, so that a callback still
/// on its way when a reader or writer leaves finds them in place.

#include <fastrtps/config.h>
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
#include <set>
#include <stdexcept>
#include <variant>

#include "common/bus/backends.h"
#include "common/bus/fastdds_events.h"
#include "common/bus/fastdds_participant.h"
#include "common/bus/fastdds_type.h"
#include "common/bus/network.h"

namespace hamel::bus {
namespace {

using eprosima::fastrtps::types::ReturnCode_t;

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
/// when a sample of that one is on its way; nor can one be taken back, or a writer be ignored.  So a reader
/// that has seen kStrangers keys that it does not hear is replaced by a new one, long before it comes there.
constexpr int kVendorInstances = 1 << 16, kStrangers = 1 << 12;

dds::DataReaderQos reader_qos(const Topic& topic, int depth, Ask ask) {
  auto qos = common_qos<dds::DataReaderQos>(topic, depth > 0 ? depth : depth_of(topic.delivery));
  qos.resource_limits().max_instances = kVendorInstances;
  qos.resource_limits().max_samples = kVendorInstances * qos.history().depth;
  if (ask == Ask::promises) promise(qos, topic, kRounding);
  if (!reliable(topic, ask)) qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
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
  /// Null inside where Fast DDS refuses.
  FastReader(const Topic& topic, dds::Topic& described, dds::DataReaderQos qos, dds::Subscriber& subscriber,
             ReaderEvents& events, const Neighbours& neighbours)
      : topic_(topic),
        described_(described),
        qos_(std::move(qos)),
        subscriber_(subscriber),
        events_(events),
        neighbours_(neighbours),
        reader_(subscriber.create_datareader(&described, qos_, &events)) {}
  ~FastReader() override { leave(); }
  bool made() const { return reader_ != nullptr; }

  bool take(Payload& payload) override {
    if (!events_.waits.exchange(false)) return false;
    if (strangers_.size() >= kStrangers) renew();
    if (reader_ == nullptr) return false;
    RawSample sample{{}, &payload, 0};
    dds::SampleInfo info;
    for (int i = 0; i < kPassedOver; ++i) {
      if (reader_->take_next_sample(&sample, &info) != ReturnCode_t::RETCODE_OK) return false;
      if (!info.valid_data) {  // an instance's state changed
        ++disposed_;
        if (!heard_.contains(info.instance_handle)) strangers_.insert(info.instance_handle);
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
    if (heard_.size() < kMaxInstances) return heard_.emplace(key, from_).second;
    strangers_.insert(key);
    return false;
  }

  void leave() {
    if (reader_ == nullptr) return;
    reader_->set_listener(nullptr);
    subscriber_.delete_datareader(reader_);
  }
  /// What waits in the old reader is lost, and what is written until the writers have found the new one.
  void renew() {
    leave();
    strangers_.clear();
    events_.matched = 0;
    reader_ = subscriber_.create_datareader(&described_, qos_, &events_);
  }

  const Topic& topic_;
  dds::Topic& described_;
  const dds::DataReaderQos qos_;
  dds::Subscriber& subscriber_;
  ReaderEvents& events_;
  const Neighbours& neighbours_;
  dds::DataReader* reader_;
  rtps::GUID_t from_;
  std::map<dds::InstanceHandle_t, rtps::GUID_t> heard_;  ///< and who wrote each last
  std::set<dds::InstanceHandle_t> strangers_;            ///< keys that are not
  std::uint64_t samples_ = 0, refused_ = 0, disposed_ = 0, passed_over_ = 0;
};

[[noreturn]] void refused(const char* what, const Topic& topic) {
  throw std::runtime_error("Fast DDS refused to create a " + std::string(what) + " for topic " +
                           std::string(topic.name));
}
template <class T>
T& checked(T* made, const char* what, const Topic& topic) {
  if (made == nullptr) refused(what, topic);
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
    auto reader = std::make_unique<FastReader>(topic, topic_for(topic), reader_qos(topic, depth, ask),
                                               *subscriber_, events, neighbours_);
    if (!reader->made()) refused("reader", topic);
    return reader;
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
