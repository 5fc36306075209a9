#pragma once
/// What Fast DDS's threads tell: about our ends, and about those of others.  Private to fastdds.cpp.

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <map>
#include <mutex>

#include "common/bus/events.h"

namespace hamel::bus {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

inline WriterId id_of(const rtps::GUID_t& guid) {
  WriterId id;
  std::copy_n(guid.guidPrefix.value, rtps::GuidPrefix_t::size, id.begin());
  std::copy_n(guid.entityId.value, rtps::EntityId_t::size, id.begin() + rtps::GuidPrefix_t::size);
  return id;
}

inline std::chrono::microseconds finite(const eprosima::fastrtps::Duration_t& d) {
  if (d == eprosima::fastrtps::c_TimeInfinite) return {};
  return std::chrono::seconds(d.seconds) + std::chrono::microseconds((d.nanosec + 500) / 1000);
}

struct WriterEvents final : Events, dds::DataWriterListener {
  using Events::Events;
  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override {
    matched = status.current_count;
  }
  void on_offered_incompatible_qos(dds::DataWriter*,
                                   const dds::OfferedIncompatibleQosStatus& status) override {
    incompatible_with(static_cast<int>(status.last_policy_id), status.total_count_change);
  }
};

struct ReaderEvents final : Events, dds::DataReaderListener {
  using Events::Events;
  void on_data_available(dds::DataReader*) override { arrived(); }
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override {
    matched = status.current_count;
  }
  void on_requested_incompatible_qos(dds::DataReader*,
                                     const dds::RequestedIncompatibleQosStatus& status) override {
    incompatible_with(static_cast<int>(status.last_policy_id), status.total_count_change);
  }
  void on_sample_lost(dds::DataReader*, const dds::SampleLostStatus& status) override {
    add(lost, status.total_count_change);
  }
  /// A key too many, or more samples than are kept.
  void on_sample_rejected(dds::DataReader*, const dds::SampleRejectedStatus& status) override {
    add(lost, static_cast<std::int32_t>(status.total_count_change));
  }
  void on_requested_deadline_missed(dds::DataReader*,
                                    const dds::RequestedDeadlineMissedStatus& status) override {
    add(late, status.total_count_change);
  }
  void on_liveliness_changed(dds::DataReader*, const dds::LivelinessChangedStatus& status) override {
    add(silent, status.not_alive_count_change);
  }
};

/// The ends of other participants, as the vendor's threads find them.
class Neighbours final : public dds::DomainParticipantListener {
 public:
  explicit Neighbours(Inbound& inbound) : inbound_(inbound) {}
  void on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& found) override {
    const bool gone = found.status == rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
                      found.status == rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT;
    const std::lock_guard lock(mutex_);
    if (gone)
      names_.erase(found.info.m_guid.guidPrefix);
    else
      names_[found.info.m_guid.guidPrefix] = found.info.m_participantName.to_string();
  }
  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& found) override {
    keep(found.info, found.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER, true);
  }
  void on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& found) override {
    keep(found.info, found.status == rtps::ReaderDiscoveryInfo::REMOVED_READER, false);
  }
  bool know(const rtps::GUID_t& end) const {
    const std::lock_guard lock(mutex_);
    return ends_.contains(end) && names_.contains(end.guidPrefix);
  }
  std::vector<Endpoint> all() const {
    const std::lock_guard lock(mutex_);
    std::vector<Endpoint> known;
    for (const auto& [guid, end] : ends_) {
      const auto name = names_.find(guid.guidPrefix);
      if (name == names_.end()) continue;  // another thread is about to tell of its participant
      known.push_back(end);
      known.back().participant = name->second;
    }
    return known;
  }

 private:
  template <class Proxy>
  void keep(const Proxy& data, bool gone, bool writes) {
    const std::lock_guard lock(mutex_);
    if (gone) {
      ends_.erase(data.guid());
      return;
    }
    Endpoint e{.topic = data.topicName().to_string(), .type = data.typeName().to_string(), .writes = writes};
    e.reliable = data.m_qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS;
    e.latched = data.m_qos.m_durability.kind != dds::VOLATILE_DURABILITY_QOS;
    e.exclusive = data.m_qos.m_ownership.kind == dds::EXCLUSIVE_OWNERSHIP_QOS;
    e.deadline = finite(data.m_qos.m_deadline.period);
    e.liveliness = finite(data.m_qos.m_liveliness.lease_duration);
    e.id = id_of(data.guid());
    if (ends_.size() < kMaxNeighbours) ends_[data.guid()] = e;
    inbound_.ends_changed();
  }

  static constexpr std::size_t kMaxNeighbours = 4096;
  Inbound& inbound_;
  mutable std::mutex mutex_;
  std::map<rtps::GUID_t, Endpoint> ends_;
  std::map<rtps::GuidPrefix_t, std::string> names_;
};

}  // namespace hamel::bus
