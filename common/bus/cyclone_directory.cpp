#include "common/bus/cyclone_directory.h"

#include <algorithm>
#include <string_view>

namespace hamel::bus::cyclone {

namespace {

WriterId id_of(const dds_guid_t& guid) {
  WriterId id;
  std::copy_n(guid.v, id.size(), id.begin());
  return id;
}

std::string name_of(const dds_builtintopic_participant_t& p) {
  char* name = nullptr;
  if (!dds_qget_entity_name(p.qos, &name) || name == nullptr) return {};
  std::string out = name;
  dds_free(name);
  return out;
}

std::chrono::microseconds finite(dds_duration_t ns) {
  return std::chrono::microseconds(ns == DDS_INFINITY ? 0 : (ns + 500) / 1000);
}

Endpoint endpoint_of(const dds_builtintopic_endpoint_t& e, bool writes) {
  Endpoint out{.topic = e.topic_name, .type = e.type_name, .writes = writes};
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  dds_ownership_kind_t ownership = DDS_OWNERSHIP_SHARED;
  dds_liveliness_kind_t liveliness = DDS_LIVELINESS_AUTOMATIC;
  dds_duration_t blocking = 0, deadline = DDS_INFINITY, lease = DDS_INFINITY;
  dds_qget_deadline(e.qos, &deadline);
  dds_qget_liveliness(e.qos, &liveliness, &lease);
  out.deadline = finite(deadline);
  out.liveliness = finite(lease);
  dds_qget_reliability(e.qos, &reliability, &blocking);
  dds_qget_durability(e.qos, &durability);
  dds_qget_ownership(e.qos, &ownership);
  out.reliable = reliability == DDS_RELIABILITY_RELIABLE;
  out.latched = durability != DDS_DURABILITY_VOLATILE;
  out.exclusive = ownership == DDS_OWNERSHIP_EXCLUSIVE;
  out.id = id_of(e.key);
  return out;
}

/// Of a built-in topic: what it says of the past is there at once.
dds_entity_t reader_of(dds_entity_t topic, dds_entity_t participant, Inbound& inbound) {
  dds_listener_t* listener = dds_create_listener(&inbound);
  dds_lset_data_available(listener,
                          [](dds_entity_t, void* news) { static_cast<Inbound*>(news)->ends_changed(); });
  const dds_entity_t reader = dds_create_reader(participant, topic, nullptr, listener);
  dds_delete_listener(listener);
  return reader;
}

/// What has come since the last time, each T with whether it still is there, freed after its use.
template <class T, class Use>
void take_all(dds_entity_t reader, Use use) {
  void* sample = nullptr;
  dds_sample_info_t info;
  while (reader > 0 && dds_take(reader, &sample, &info, 1, 1) == 1) {
    use(*static_cast<const T*>(sample), info.valid_data && info.instance_state == DDS_IST_ALIVE);
    dds_return_loan(reader, &sample, 1);
  }
}

}  // namespace

Directory::Directory(dds_entity_t participant, Inbound& inbound)
    : writers_(reader_of(DDS_BUILTIN_TOPIC_DCPSPUBLICATION, participant, inbound)),
      readers_(reader_of(DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, participant, inbound)),
      participants_(reader_of(DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, participant, inbound)) {
  dds_guid_t own{};
  dds_get_guid(participant, &own);
  own_ = id_of(own);
}

std::vector<Endpoint> Directory::others() {
  for (const bool writes : {true, false})
    take_all<dds_builtintopic_endpoint_t>(writes ? writers_ : readers_, [&](const auto& e, bool alive) {
      const WriterId participant = id_of(e.participant_key);
      if (!alive)
        ends_.erase(id_of(e.key));
      else if (participant != own_ && !std::string_view(e.topic_name).starts_with("DCPS"))  // built in
        ends_[id_of(e.key)] = {participant, endpoint_of(e, writes)};
    });
  // Read last: Cyclone finds a participant before its ends.
  take_all<dds_builtintopic_participant_t>(participants_, [&](const auto& p, bool alive) {
    if (alive && id_of(p.key) != own_)
      names_[id_of(p.key)] = name_of(p);
    else
      names_.erase(id_of(p.key));
  });
  std::vector<Endpoint> all;
  for (const auto& [id, end] : ends_) {
    const auto name = names_.find(end.first);
    if (name == names_.end()) continue;  // gone meanwhile
    all.push_back(end.second);
    all.back().participant = name->second;
  }
  return all;
}

}  // namespace hamel::bus::cyclone
