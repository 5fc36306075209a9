#include <cstdlib>
#include <stdexcept>
#include <string>

#include "dds/dds.h"
#include "hamel_v1.h"
#include "tests/integration/interop.h"

namespace hamel::test {
namespace {

std::uint32_t number_in(const hamel_v1_Goal& m) { return static_cast<std::uint32_t>(m.id); }
std::uint32_t number_in(const hamel_v1_TorqueCommand& m) { return static_cast<std::uint32_t>(m.step); }
void set_number(hamel_v1_Goal& m, std::uint32_t n) { m.id = n; }
void set_number(hamel_v1_TorqueCommand& m, std::uint32_t n) { m.step = n; }

dds_entity_t participant(unsigned domain) {
  setenv("CYCLONEDDS_URI", "file://" HAMEL_SOURCE_DIR "/deploy/qos/cyclonedds.xml", 1);
  const dds_entity_t made = dds_create_participant(domain, nullptr, nullptr);
  if (made < 0) throw std::runtime_error("Cyclone DDS refuses deploy/qos/cyclonedds.xml");
  return made;
}

/// A participant with a topic, configured as deploy/qos says.
class End {
 protected:
  End(const Topic& topic, unsigned domain, const dds_topic_descriptor_t& type)
      : participant_(participant(domain)),
        topic_(dds_create_topic(participant_, &type, std::string(topic.name).c_str(), nullptr, nullptr)) {}
  ~End() { dds_delete(participant_); }

  static dds_qos_t* qos(const Topic& topic, int more_ms) {
    dds_qos_t* q = dds_create_qos();
    dds_qset_reliability(q, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(q, DDS_HISTORY_KEEP_LAST, depth_of(topic.delivery));
    if (topic.delivery == Delivery::latched) dds_qset_durability(q, DDS_DURABILITY_TRANSIENT_LOCAL);
    if (topic.rate_hz > 0) dds_qset_deadline(q, DDS_MSECS(topic.stale.count() + more_ms));
    dds_qset_liveliness(q, DDS_LIVELINESS_AUTOMATIC, DDS_MSECS(kLease_ms + more_ms));
    dds_qset_writer_data_lifecycle(q, false);
    return q;
  }

  const dds_entity_t participant_, topic_;
};

template <class T>
class CycloneWriter final : public WriterEnd, End {
 public:
  CycloneWriter(const Topic& topic, unsigned domain, const dds_topic_descriptor_t& type)
      : End(topic, domain, type) {
    dds_qos_t* q = qos(topic, 0);
    writer_ = dds_create_writer(participant_, topic_, q, nullptr);
    dds_delete_qos(q);
  }
  void write(std::uint32_t key, std::uint32_t number) override {
    T m = of(key);
    set_number(m, number);
    dds_write(writer_, &m);
  }
  void dispose(std::uint32_t key) override {
    const T m = of(key);
    dds_dispose(writer_, &m);
  }
  void unregister(std::uint32_t key) override {
    const T m = of(key);
    dds_unregister_instance(writer_, &m);
  }

 private:
  static T of(std::uint32_t key) {
    T m{};
    m.arm = key;
    return m;
  }
  dds_entity_t writer_ = 0;
};

template <class T>
class CycloneReader final : public ReaderEnd, End {
 public:
  CycloneReader(const Topic& topic, unsigned domain, const dds_topic_descriptor_t& type)
      : End(topic, domain, type) {
    dds_qos_t* q = qos(topic, kRounding_ms);
    reader_ = dds_create_reader(participant_, topic_, q, nullptr);
    dds_delete_qos(q);
  }
  std::optional<Sight> take() override {
    void* samples[1] = {nullptr};
    dds_sample_info_t info;
    if (dds_take(reader_, samples, &info, 1, 1) != 1) return {};
    const T& m = *static_cast<const T*>(samples[0]);
    Sight s{Sight::data, m.arm, number_in(m)};
    if (!info.valid_data)
      s.what = info.instance_state == DDS_IST_NOT_ALIVE_DISPOSED ? Sight::disposed : Sight::left;
    dds_return_loan(reader_, samples, 1);
    return s;
  }
  int writers() override {
    dds_subscription_matched_status_t status{};
    dds_get_subscription_matched_status(reader_, &status);
    return static_cast<int>(status.current_count);
  }
  int late() override {
    dds_requested_deadline_missed_status_t status{};
    dds_get_requested_deadline_missed_status(reader_, &status);
    return static_cast<int>(status.total_count);
  }
  int silent() override {
    dds_liveliness_changed_status_t status{};
    dds_get_liveliness_changed_status(reader_, &status);
    return static_cast<int>(status.not_alive_count);
  }

 private:
  dds_entity_t reader_ = 0;
};

template <class Interface, template <class> class Made>
std::unique_ptr<Interface> make(const Topic& topic, unsigned domain) {
  if (topic.name == topics::kGoal.name)
    return std::make_unique<Made<hamel_v1_Goal>>(topic, domain, hamel_v1_Goal_desc);
  if (topic.name == topics::kCommand.name)
    return std::make_unique<Made<hamel_v1_TorqueCommand>>(topic, domain, hamel_v1_TorqueCommand_desc);
  throw std::logic_error("no such topic");
}

}  // namespace

std::unique_ptr<WriterEnd> cyclone_writer(const Topic& topic, unsigned domain) {
  return make<WriterEnd, CycloneWriter>(topic, domain);
}
std::unique_ptr<ReaderEnd> cyclone_reader(const Topic& topic, unsigned domain) {
  return make<ReaderEnd, CycloneReader>(topic, domain);
}

}  // namespace hamel::test
