#include <string>

#include "dds/dds.h"
#include "hamel_v1.h"
#include "idl/topics.h"
#include "tests/bench/bare.h"

namespace hamel::bench {
namespace {

constexpr const char* kLoopback =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery><Internal><Watermarks><WhcHigh>1GB</WhcHigh>"
    "</Watermarks></Internal></Domain></CycloneDDS>";

double joints[kJoints] = {0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5};
hamel_v1_Cause causes[3] = {};

template <class Sequence>
void set(Sequence& s) {
  s = {kJoints, kJoints, joints, false};
}
void fill(hamel_v1_ArmState& m) {
  m.arm = 1;
  set(m.position), set(m.velocity), set(m.momentum), set(m.torque_applied);
  m.caused_by = {1, 1, causes, false};
}
void fill(hamel_v1_TorqueCommand& m) {
  m.arm = 1;
  set(m.torque);
  m.caused_by = {3, 3, causes, false};
}

template <class Out, class In>
class CycloneEnd final : public BareEnd {
 public:
  CycloneEnd(const Topic& to, const dds_topic_descriptor_t& out, const Topic& from,
             const dds_topic_descriptor_t& in, std::uint32_t domain)
      : domain_(dds_create_domain(domain, kLoopback)),
        participant_(dds_create_participant(domain, nullptr, nullptr)) {
    fill(out_);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kStreamDepth);
    dds_qset_resource_limits(qos, 64 * kStreamDepth, 64, kStreamDepth);
    dds_listener_t* listener = dds_create_listener(&bell);
    dds_lset_data_available(listener, [](dds_entity_t, void* rung) { static_cast<Bell*>(rung)->ring(); });
    reader_ = dds_create_reader(participant_, topic(from, in), qos, listener);
    dds_delete_listener(listener);
    dds_qset_deadline(qos, DDS_MSECS(50));
    dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_MSECS(1000));
    writer_ = dds_create_writer(participant_, topic(to, out), qos, nullptr);
    dds_delete_qos(qos);
  }
  ~CycloneEnd() override {
    dds_set_listener(reader_, nullptr);
    dds_delete(domain_);
  }
  bool matched() override {
    dds_publication_matched_status_t to{};
    dds_subscription_matched_status_t from{};
    dds_get_publication_matched_status(writer_, &to);
    dds_get_subscription_matched_status(reader_, &from);
    return to.current_count > 0 && from.current_count > 0;
  }
  void write(std::uint64_t number) override {
    out_.step = number;
    dds_write(writer_, &out_);
  }
  std::uint64_t take() override {
    void* sample = nullptr;
    dds_sample_info_t info;
    std::uint64_t number = 0;
    while (number == 0 && dds_take(reader_, &sample, &info, 1, 1) == 1) {
      if (info.valid_data) number = static_cast<const In*>(sample)->step;
      dds_return_loan(reader_, &sample, 1);
      sample = nullptr;
    }
    return number;
  }

 private:
  dds_entity_t topic(const Topic& t, const dds_topic_descriptor_t& descriptor) {
    return dds_create_topic(participant_, &descriptor, std::string(t.name).c_str(), nullptr, nullptr);
  }
  dds_entity_t domain_, participant_, writer_ = 0, reader_ = 0;
  Out out_{};
};

}  // namespace

std::unique_ptr<BareEnd> bare_cyclone(bool asks, std::uint32_t domain) {
  if (asks)
    return std::make_unique<CycloneEnd<hamel_v1_ArmState, hamel_v1_TorqueCommand>>(
        topics::kState, hamel_v1_ArmState_desc, topics::kCommand, hamel_v1_TorqueCommand_desc, domain);
  return std::make_unique<CycloneEnd<hamel_v1_TorqueCommand, hamel_v1_ArmState>>(
      topics::kCommand, hamel_v1_TorqueCommand_desc, topics::kState, hamel_v1_ArmState_desc, domain);
}

}  // namespace hamel::bench
