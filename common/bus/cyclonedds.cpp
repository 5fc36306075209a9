/// The bus over Cyclone DDS: bytes pass through, listeners only notify.
///
/// Cyclone has one configuration per domain and process; nodes of one domain share it.  Its listeners get a
/// pointer to events that the node owns until the participant is gone.

#include <algorithm>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <variant>

#include "common/bus/backends.h"
#include "common/bus/cyclone_config.h"
#include "common/bus/cyclone_directory.h"
#include "common/bus/cyclone_sertype.h"
#include "common/bus/events.h"
#include "common/bus/payload.h"
#include "dds/dds.h"
#include "dds/version.h"

namespace hamel::bus {
namespace {

/// What Cyclone logged last, for the sentence about a refusal; it would print to stderr otherwise.
class LastWords {
 public:
  static LastWords& get() {
    static LastWords words;
    return words;
  }
  std::string take() {
    std::lock_guard lock(mutex_);
    return std::move(text_);
  }

 private:
  LastWords() {
    dds_set_log_mask(DDS_LC_FATAL | DDS_LC_ERROR);
    dds_set_log_sink(
        [](void* self, const dds_log_data_t* data) { static_cast<LastWords*>(self)->keep(*data); }, this);
  }
  void keep(const dds_log_data_t& data) {
    std::lock_guard lock(mutex_);
    text_.assign(data.message, data.size);
    while (!text_.empty() && text_.back() == '\n') text_.pop_back();
  }
  std::mutex mutex_;
  std::string text_;
};

std::string refusal(dds_return_t code) {
  const std::string words = LastWords::get().take();
  return "Cyclone DDS refuses: " + (words.empty() ? std::string(dds_strretcode(-code)) : words);
}

/// One domain of this process, deleted with its last node.
class Domain {
 public:
  ~Domain() { dds_delete(entity_); }

  static Result<std::shared_ptr<Domain>, Problem> of(const NodeOptions& options, const Interface& interface) {
    static std::mutex mutex;
    static std::map<std::uint32_t, std::weak_ptr<Domain>> domains;
    std::lock_guard lock(mutex);
    const std::string wanted = cyclone::configuration(options, interface);
    if (auto domain = domains[options.domain].lock()) {
      if (domain->configuration_ == wanted) return domain;
      return Problem{"domain", "= " + std::to_string(options.domain) +
                                   ", is already open in this process with another interface or other peers"};
    }
    if (const auto index = free_participant_index(options.domain); !index) return index.error();
    const dds_entity_t entity = dds_create_domain(options.domain, wanted.c_str());
    if (entity < 0) return Problem{"domain", "= " + std::to_string(options.domain) + ", " + refusal(entity)};
    std::shared_ptr<Domain> domain(new Domain(entity, wanted));
    domains[options.domain] = domain;
    return domain;
  }

 private:
  Domain(dds_entity_t entity, std::string configuration)
      : entity_(entity), configuration_(std::move(configuration)) {}
  const dds_entity_t entity_;
  const std::string configuration_;
};

Events& events_of(void* arg) { return *static_cast<Events*>(arg); }

struct Deleter {
  void operator()(dds_listener_t* l) const { dds_delete_listener(l); }
  void operator()(dds_qos_t* q) const { dds_delete_qos(q); }
};
using Listener = std::unique_ptr<dds_listener_t, Deleter>;
using Qos = std::unique_ptr<dds_qos_t, Deleter>;

/// Cyclone counts one policy more before the representation of data than the specification.
int policy_of(std::uint32_t id) {
  return id == DDS_DATA_REPRESENTATION_QOS_POLICY_ID ? 23 : static_cast<int>(id);
}

Listener listener_for(Events& events) {
  Listener l(dds_create_listener(&events));
  dds_lset_data_available(l.get(), [](dds_entity_t, void* arg) { events_of(arg).arrived(); });
  dds_lset_subscription_matched(l.get(),
                                [](dds_entity_t, dds_subscription_matched_status_t status, void* arg) {
                                  events_of(arg).matched = static_cast<int>(status.current_count);
                                });
  dds_lset_publication_matched(l.get(), [](dds_entity_t, dds_publication_matched_status_t status, void* arg) {
    events_of(arg).matched = static_cast<int>(status.current_count);
  });
  dds_lset_requested_incompatible_qos(
      l.get(), [](dds_entity_t, dds_requested_incompatible_qos_status_t status, void* arg) {
        events_of(arg).incompatible_with(policy_of(status.last_policy_id), status.total_count_change);
      });
  dds_lset_offered_incompatible_qos(
      l.get(), [](dds_entity_t, dds_offered_incompatible_qos_status_t status, void* arg) {
        events_of(arg).incompatible_with(policy_of(status.last_policy_id), status.total_count_change);
      });
  dds_lset_sample_lost(l.get(), [](dds_entity_t, dds_sample_lost_status_t status, void* arg) {
    Events::add(events_of(arg).lost, status.total_count_change);
  });
  dds_lset_requested_deadline_missed(
      l.get(), [](dds_entity_t, dds_requested_deadline_missed_status_t status, void* arg) {
        Events::add(events_of(arg).late, status.total_count_change);
      });
  dds_lset_liveliness_changed(l.get(), [](dds_entity_t, dds_liveliness_changed_status_t status, void* arg) {
    Events::add(events_of(arg).silent, status.not_alive_count_change);
  });
  return l;
}

/// The promises of a topic's writers are offered by each, asked for by some readers.
Qos qos_for(const Topic& topic, bool writes, int depth, Ask ask) {
  const bool promises = writes || ask == Ask::promises;
  const bool latched = topic.delivery == Delivery::latched;
  const auto more = writes ? std::chrono::milliseconds(0) : kRounding;
  Qos q(dds_create_qos());
  dds_qset_reliability(q.get(), reliable(topic, ask) ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_MSECS(100));
  dds_qset_durability(q.get(), latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(q.get(), DDS_HISTORY_KEEP_LAST, depth);
  if (promises && topic.rate_hz > 0) dds_qset_deadline(q.get(), DDS_MSECS((topic.stale + more).count()));
  if (promises) dds_qset_liveliness(q.get(), DDS_LIVELINESS_AUTOMATIC, DDS_MSECS((kAlive + more).count()));
  if (writes) dds_qset_writer_data_lifecycle(q.get(), false);
  return q;
}

class CycloneWriter final : public Writer {
 public:
  CycloneWriter(const Topic& topic, dds_entity_t writer, Events& events)
      : topic_(topic), writer_(writer), events_(events) {}
  ~CycloneWriter() override {
    dds_set_listener(writer_, nullptr);
    dds_delete(writer_);
  }

  bool write(std::span<const std::byte> payload) override {
    const bool sent = acceptable(payload, topic_) && dds_write(writer_, &payload) == DDS_RETCODE_OK;
    ++(sent ? samples_ : refused_);
    return sent;
  }
  bool dispose(std::span<const std::byte> payload) override {
    return acceptable(payload, topic_) && dds_dispose(writer_, &payload) == DDS_RETCODE_OK;
  }
  WriterId id() const override {
    WriterId id{};
    dds_guid_t guid;
    if (dds_get_guid(writer_, &guid) == DDS_RETCODE_OK) std::copy_n(guid.v, id.size(), id.begin());
    return id;
  }
  int matched() const override { return events_.matched; }
  Counters counters() const override { return events_.counters(samples_, refused_); }

 private:
  const Topic& topic_;
  const dds_entity_t writer_;
  Events& events_;
  std::uint64_t samples_ = 0, refused_ = 0;
};

class CycloneReader final : public Reader {
 public:
  CycloneReader(const Topic& topic, dds_entity_t reader, Events& events,
                std::shared_ptr<const cyclone::Keys> keys)
      : topic_(topic),
        reader_(reader),
        events_(events),
        keys_(std::move(keys)),
        dropped_before_(keys_->dropped()) {}
  ~CycloneReader() override {
    dds_set_listener(reader_, nullptr);
    dds_delete(reader_);
  }

  bool take(Payload& payload) override {
    if (!events_.waits.exchange(false)) return false;
    ddsi_serdata* data = nullptr;
    dds_sample_info_t info;
    for (int i = 0; i < kPassedOver; ++i) {
      if (dds_takecdr(reader_, &data, 1, &info, DDS_ANY_STATE) != 1) return false;
      const bool good = info.valid_data && copy(*static_cast<const cyclone::Sample*>(data), payload);
      disposed_ += !info.valid_data;
      ddsi_serdata_unref(data);
      from_ = info.publication_handle;
      if (!good) continue;
      events_.waits = true;  // more, perhaps
      return true;
    }
    events_.arrived();
    return false;
  }
  WriterId from() const override {
    if (const auto known = ids_.find(from_); known != ids_.end()) return known->second;
    WriterId id{};
    std::memcpy(id.data(), &from_, sizeof from_);  // a writer that has left since: a number of its own
    auto* writer = dds_get_matched_publication_data(reader_, from_);
    if (writer == nullptr) return id;
    std::copy_n(writer->key.v, id.size(), id.begin());
    dds_builtintopic_free_endpoint(writer);
    if (ids_.size() >= kMaxInstances) ids_.clear();
    ids_[from_] = id;
    return id;
  }
  int matched() const override { return events_.matched; }
  Counters counters() const override {
    Counters c = events_.counters(samples_, refused_, disposed_);
    c.lost += keys_->dropped() - dropped_before_;
    return c;
  }

 private:
  bool copy(const cyclone::Sample& sample, Payload& payload) {
    const auto bytes = sample.payload();
    const bool good = sample.claimed <= bytes.size() && acceptable(bytes, topic_);
    ++(good ? samples_ : refused_);
    if (good) payload.assign(bytes.begin(), bytes.end());
    return good;
  }

  const Topic& topic_;
  const dds_entity_t reader_;
  Events& events_;
  const std::shared_ptr<const cyclone::Keys> keys_;
  const std::uint64_t dropped_before_;
  dds_instance_handle_t from_ = 0;
  mutable std::map<dds_instance_handle_t, WriterId> ids_;
  std::uint64_t samples_ = 0, refused_ = 0, disposed_ = 0;
};

dds_entity_t checked(dds_entity_t made, const char* what, const Topic& topic) {
  if (made >= 0) return made;
  throw std::runtime_error(std::string(what) + " for topic " + std::string(topic.name) + ": " +
                           refusal(made));
}

class CycloneNode final : public Node {
 public:
  CycloneNode(const NodeOptions& options, std::shared_ptr<Domain> domain)
      : options_(options), domain_(std::move(domain)) {}
  ~CycloneNode() override {
    if (participant_ > 0) dds_delete(participant_);
  }

  dds_return_t start() {
    const Qos qos(dds_create_qos());
    dds_qset_entity_name(qos.get(), options_.name.c_str());
    participant_ = dds_create_participant(options_.domain, qos.get(), nullptr);
    if (participant_ > 0) directory_.emplace(participant_, inbound_);
    return participant_;
  }

  std::unique_ptr<Writer> writer(const Topic& topic) override {
    Events& events = make_events(topic, true, Ask::data);
    const dds_entity_t made = dds_create_writer(
        participant_, topic_for(topic).entity,
        qos_for(topic, true, depth_of(topic.delivery), Ask::data).get(), listener_for(events).get());
    return std::make_unique<CycloneWriter>(topic, checked(made, "writer", topic), events);
  }

  std::unique_ptr<Reader> reader(const Topic& topic, int depth, Ask ask) override {
    Events& events = make_events(topic, false, ask);
    if (depth <= 0) depth = depth_of(topic.delivery);
    const dds_entity_t made =
        dds_create_reader(participant_, topic_for(topic).entity, qos_for(topic, false, depth, ask).get(),
                          listener_for(events).get());
    return std::make_unique<CycloneReader>(topic, checked(made, "reader", topic), events,
                                           topic_for(topic).keys);
  }

  std::vector<Endpoint> endpoints() override { return directory_->others(); }
  std::uint64_t incompatible() const override { return inbound_.incompatible(); }
  std::string complaint() const override { return complaints_.last(); }
  bool wait(std::chrono::steady_clock::time_point deadline) override {
    return inbound_.wait(
        deadline, options_.awake,
        [this](const Disagreement& d) { complaints_.tell(d, Vendor::cyclonedds, endpoints(), options_.log); },
        [this] { complaints_.look(Vendor::cyclonedds, endpoints(), options_.log); });
  }
  void wake() noexcept override { inbound_.notifier.notify(); }
  const NodeOptions& options() const override { return options_; }

 private:
  Events& make_events(const Topic& topic, bool writes, Ask ask) {
    events_.push_back(std::make_unique<Events>(topic, inbound_, writes, ask));
    return *events_.back();
  }

  const cyclone::CycloneTopic& topic_for(const Topic& topic) {
    cyclone::CycloneTopic& made = topics_[topic.name];
    if (made.entity <= 0) {
      made = cyclone::create_topic(participant_, topic);
      complaints_.watch(topic);
      inbound_.ends_changed();
    }
    checked(made.entity, "topic", topic);
    return made;
  }

  const NodeOptions options_;
  const std::shared_ptr<Domain> domain_;
  Inbound inbound_;
  Complaints complaints_;
  std::vector<std::unique_ptr<Events>> events_;  // until the participant is gone
  std::map<std::string_view, cyclone::CycloneTopic> topics_;
  std::optional<cyclone::Directory> directory_;
  dds_entity_t participant_ = 0;
};

}  // namespace

std::string cyclonedds_version() { return DDS_VERSION; }

Result<std::unique_ptr<Node>, Problem> open_cyclonedds(const NodeOptions& options) {
  LastWords::get();
  const auto interface = find_interface(options.interface_name);
  if (!interface) return interface.error();
  if (const auto peers = check_peers(options.peers); !peers) return peers.error();
  if (!options.discovery_server.empty())
    return Problem{"discovery server", "= " + options.discovery_server +
                                           ", is Fast DDS's own; with cyclonedds name the hosts as peers"};
  if (!options.security.empty())
    if (const auto identity = find_identity(options.security); !identity) return identity.error();
  auto domain = Domain::of(options, interface.value());
  if (!domain) return domain.error();
  auto node = std::make_unique<CycloneNode>(options, std::move(domain).value());
  if (const dds_return_t made = node->start(); made < 0)
    return Problem{"domain", "= " + std::to_string(options.domain) + ", " + refusal(made)};
  return std::unique_ptr<Node>(std::move(node));
}

}  // namespace hamel::bus
