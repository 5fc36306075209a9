#include "tests/integration/interop.h"

#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <stdexcept>

#include "hamel_v1PubSubTypes.h"

namespace hamel::test {
namespace {

using namespace hamel::v1;
namespace dds = eprosima::fastdds::dds;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

std::uint32_t number_in(const Goal& m) { return static_cast<std::uint32_t>(m.id()); }
std::uint32_t number_in(const TorqueCommand& m) { return static_cast<std::uint32_t>(m.step()); }
void set_number(Goal& m, std::uint32_t n) { m.id(n); }
void set_number(TorqueCommand& m, std::uint32_t n) { m.step(n); }

Duration_t duration_of(long ms) { return Duration_t(static_cast<long double>(ms) * 1e-3L); }

dds::DomainParticipant* participant(unsigned domain) {
  setenv("FASTRTPS_DEFAULT_PROFILES_FILE", HAMEL_SOURCE_DIR "/deploy/qos/fastdds.xml", 1);
  auto* made =
      dds::DomainParticipantFactory::get_instance()->create_participant_with_profile(domain, "hamel");
  if (made == nullptr) throw std::runtime_error("deploy/qos/fastdds.xml has no profile hamel");
  return made;
}

/// What fits a topic, to begin with: the profile of its delivery in deploy/qos.
const char* profile(const Topic& topic) { return topic.delivery == Delivery::latched ? "latched" : "stream"; }
void expect(ReturnCode_t code) {
  if (code != ReturnCode_t::RETCODE_OK)
    throw std::runtime_error("deploy/qos/fastdds.xml has no such profile");
}

/// A participant with a topic, configured as deploy/qos says.
class End {
 protected:
  End(const Topic& topic, unsigned domain, dds::TopicDataType* made) : participant_(participant(domain)) {
    const dds::TypeSupport type(made);
    type.register_type(participant_);
    topic_ =
        participant_->create_topic(std::string(topic.name), type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  ~End() {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  template <class Qos>
  static void promise(Qos& q, const Topic& topic, int more_ms) {
    if (topic.rate_hz > 0) q.deadline().period = duration_of(topic.stale.count() + more_ms);
    q.liveliness().lease_duration = duration_of(kLease_ms + more_ms);
    q.liveliness().announcement_period = duration_of(kLease_ms / 3);
  }

  dds::DomainParticipant* participant_;
  dds::Topic* topic_ = nullptr;
};

template <class T, class PubSubType>
class FastWriter final : public WriterEnd, End {
 public:
  FastWriter(const Topic& topic, unsigned domain) : End(topic, domain, new PubSubType) {
    auto* publisher = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    dds::DataWriterQos q;
    expect(publisher->get_datawriter_qos_from_profile(profile(topic), q));
    promise(q, topic, 0);
    q.writer_data_lifecycle().autodispose_unregistered_instances = false;
    writer_ = publisher->create_datawriter(topic_, q);
  }
  void write(std::uint32_t key, std::uint32_t number) override {
    T m = of(key);
    set_number(m, number);
    writer_->write(&m);
  }
  void dispose(std::uint32_t key) override {
    T m = of(key);
    writer_->dispose(&m, dds::HANDLE_NIL);
  }
  void unregister(std::uint32_t key) override {
    T m = of(key);
    writer_->unregister_instance(&m, dds::HANDLE_NIL);
  }

 private:
  static T of(std::uint32_t key) {
    T m;
    m.arm(key);
    return m;
  }
  dds::DataWriter* writer_ = nullptr;
};

template <class T, class PubSubType>
class FastReader final : public ReaderEnd, End {
 public:
  FastReader(const Topic& topic, unsigned domain) : End(topic, domain, new PubSubType) {
    auto* subscriber = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
    dds::DataReaderQos q;
    expect(subscriber->get_datareader_qos_from_profile(profile(topic), q));
    promise(q, topic, kRounding_ms);
    reader_ = subscriber->create_datareader(topic_, q);
  }
  std::optional<Sight> take() override {
    T m;
    dds::SampleInfo info;
    if (reader_->take_next_sample(&m, &info) != ReturnCode_t::RETCODE_OK) return {};
    if (info.valid_data) return Sight{Sight::data, m.arm(), number_in(m)};
    const bool disposed = info.instance_state == dds::NOT_ALIVE_DISPOSED_INSTANCE_STATE;
    return Sight{disposed ? Sight::disposed : Sight::left, key_of(info.instance_handle), 0};
  }
  int writers() override {
    dds::SubscriptionMatchedStatus status;
    reader_->get_subscription_matched_status(status);
    return status.current_count;
  }
  int late() override {
    dds::RequestedDeadlineMissedStatus status;
    reader_->get_requested_deadline_missed_status(status);
    return static_cast<int>(status.total_count);
  }
  int silent() override {
    dds::LivelinessChangedStatus status;
    reader_->get_liveliness_changed_status(status);
    return static_cast<int>(status.not_alive_count);
  }

 private:
  /// RTPS 9.6.3.8: a short key is its own handle, big endian.
  static std::uint32_t key_of(const dds::InstanceHandle_t& handle) {
    std::uint32_t key = 0;
    for (int i = 0; i < 4; ++i) key = key << 8 | handle.value[i];
    return key;
  }
  dds::DataReader* reader_ = nullptr;
};

template <class Interface, template <class, class> class Made>
std::unique_ptr<Interface> make(const Topic& topic, unsigned domain) {
  if (topic.name == topics::kGoal.name) return std::make_unique<Made<Goal, GoalPubSubType>>(topic, domain);
  if (topic.name == topics::kCommand.name)
    return std::make_unique<Made<TorqueCommand, TorqueCommandPubSubType>>(topic, domain);
  throw std::logic_error("no such topic");
}

}  // namespace

std::unique_ptr<WriterEnd> fast_writer(const Topic& topic, unsigned domain) {
  return make<WriterEnd, FastWriter>(topic, domain);
}
std::unique_ptr<ReaderEnd> fast_reader(const Topic& topic, unsigned domain) {
  return make<ReaderEnd, FastReader>(topic, domain);
}

}  // namespace hamel::test
