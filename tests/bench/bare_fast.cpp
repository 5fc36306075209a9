#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "hamel_v1PubSubTypes.h"
#include "idl/topics.h"
#include "tests/bench/bare.h"
#include "tests/support/loopback_fast.h"

namespace hamel::bench {
namespace {

using namespace hamel::v1;
namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::types::ReturnCode_t;

template <class Qos>
Qos common_qos() {
  Qos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = kStreamDepth;
  qos.resource_limits().max_samples_per_instance = kStreamDepth;
  qos.resource_limits().max_instances = 64;
  qos.resource_limits().max_samples = 64 * kStreamDepth;
  qos.resource_limits().allocated_samples = 32;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
  return qos;
}

void fill(ArmState& m) {
  const std::vector<double> q(kJoints, 0.5);
  m.arm(1), m.position(q), m.velocity(q), m.momentum(q), m.torque_applied(q), m.caused_by().resize(1);
}
void fill(TorqueCommand& m) {
  m.arm(1), m.torque(std::vector<double>(kJoints, 0.5)), m.caused_by().resize(3);
}

template <class Out, class OutType, class In, class InType>
class FastEnd final : public BareEnd, dds::DataReaderListener {
 public:
  FastEnd(const Topic& to, const Topic& from, std::uint32_t domain)
      : participant_(test::loopback_participant(domain)) {
    fill(out_);
    auto wqos = common_qos<dds::DataWriterQos>();
    wqos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
    wqos.reliable_writer_qos().times.heartbeatPeriod = eprosima::fastrtps::Duration_t(0, 100000000);
    wqos.deadline().period = eprosima::fastrtps::Duration_t(0, 50000000);
    wqos.liveliness().lease_duration = eprosima::fastrtps::Duration_t(1, 0);
    wqos.liveliness().announcement_period = eprosima::fastrtps::Duration_t(0, 333000000);
    writer_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT)
                  ->create_datawriter(topic<OutType>(to), wqos);
    reader_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
                  ->create_datareader(topic<InType>(from), common_qos<dds::DataReaderQos>(), this,
                                      dds::StatusMask::data_available());
  }
  ~FastEnd() override {
    reader_->set_listener(nullptr);
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  void on_data_available(dds::DataReader*) override { bell.ring(); }
  bool matched() override {
    dds::PublicationMatchedStatus to;
    dds::SubscriptionMatchedStatus from;
    writer_->get_publication_matched_status(to);
    reader_->get_subscription_matched_status(from);
    return to.current_count > 0 && from.current_count > 0;
  }
  void write(std::uint64_t number) override {
    out_.step(number);
    writer_->write(&out_);
  }
  std::uint64_t take() override {
    dds::SampleInfo info;
    while (reader_->take_next_sample(&in_, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) return in_.step();
    return 0;
  }

 private:
  template <class Type>
  dds::Topic* topic(const Topic& t) {
    const dds::TypeSupport type(new Type);
    type.register_type(participant_);
    return participant_->create_topic(std::string(t.name), type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  dds::DomainParticipant* participant_;
  dds::DataWriter* writer_ = nullptr;
  dds::DataReader* reader_ = nullptr;
  Out out_;
  In in_;
};

}  // namespace

std::unique_ptr<BareEnd> bare_fast(bool asks, std::uint32_t domain) {
  if (asks)
    return std::make_unique<FastEnd<ArmState, ArmStatePubSubType, TorqueCommand, TorqueCommandPubSubType>>(
        topics::kState, topics::kCommand, domain);
  return std::make_unique<FastEnd<TorqueCommand, TorqueCommandPubSubType, ArmState, ArmStatePubSubType>>(
      topics::kCommand, topics::kState, domain);
}

}  // namespace hamel::bench
