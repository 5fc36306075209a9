/// The bus over Cyclone DDS: bytes pass through, listeners only notify.
///
/// Cyclone has one configuration per domain and process; nodes of one domain share it.  Its listeners get a
/// pointer to events that the node owns until the participant is gone.

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <stdexcept>
#include <variant>

#include "common/bus/backends.h"
#include "common/bus/cyclone_sertype.h"
#include "common/bus/network.h"
#include "common/bus/notifier.h"
#include "common/bus/payload.h"
#include "dds/dds.h"

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

std::string element(const std::string& name, const std::string& inside) {
  return "<" + name + ">" + inside + "</" + name + ">";
}
std::string element(const std::string& name, std::chrono::milliseconds ms) {
  return element(name, std::to_string(ms.count()) + "ms");
}

/// Whole, so that CYCLONEDDS_URI is not asked: a foreign setting must not move the arm's bus.
std::string configuration(const NodeOptions& options, const Interface& interface) {
  const auto peers = unicast_peers(options, interface);
  std::string list;
  for (const std::string& peer : peers) list += "<Peer Address=\"" + peer + "\"/>";
  const std::string general =
      element("Interfaces", "<NetworkInterface address=\"" + interface.address + "\"/>") +
      element("AllowMulticast", peers.empty() ? "spdp" : "false");
  // Cyclone tries indices below the maximum.
  const std::string discovery = element("ParticipantIndex", "auto") +
                                element("MaxAutoParticipantIndex", std::to_string(kMaxParticipantIndex + 1)) +
                                element("LeaseDuration", kLease) + element("SPDPInterval", kAnnouncement) +
                                element("Peers", list);
  // A writer waits for slow readers above this mark; keep-last already bounds what it holds.
  const std::string internal = element("Watermarks", element("WhcHigh", "1GB"));
  return element("CycloneDDS",
                 element("Domain", element("General", general) + element("Discovery", discovery) +
                                       element("Internal", internal)));
}

/// One domain of this process, deleted with its last node.
class Domain {
 public:
  ~Domain() { dds_delete(entity_); }

  static Result<std::shared_ptr<Domain>, Problem> of(const NodeOptions& options, const Interface& interface) {
    static std::mutex mutex;
    static std::map<std::uint32_t, std::weak_ptr<Domain>> domains;
    std::lock_guard lock(mutex);
    const std::string wanted = configuration(options, interface);
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

/// What the vendor's threads tell about one end.
struct Events {
  Events(const Topic& t, const NodeOptions& o, Notifier& n, bool writes)
      : topic(t), options(o), notifier(n), we_write(writes) {}

  void incompatible_with(std::uint32_t policy, std::int32_t change) {
    if (!logged.exchange(true) && options.log)
      options.log(incompatible_sentence(topic, we_write, static_cast<int>(policy), Vendor::cyclonedds));
    incompatible += static_cast<std::uint64_t>(std::max(change, 0));
  }

  const Topic& topic;
  const NodeOptions& options;
  Notifier& notifier;
  const bool we_write;
  std::atomic<int> matched{0};
  std::atomic<std::uint64_t> incompatible{0}, lost{0};
  std::atomic<bool> logged{false};
};

Events& events_of(void* arg) { return *static_cast<Events*>(arg); }

struct Deleter {
  void operator()(dds_listener_t* l) const { dds_delete_listener(l); }
  void operator()(dds_qos_t* q) const { dds_delete_qos(q); }
};
using Listener = std::unique_ptr<dds_listener_t, Deleter>;
using Qos = std::unique_ptr<dds_qos_t, Deleter>;

Listener listener_for(Events& events) {
  Listener l(dds_create_listener(&events));
  dds_lset_data_available(l.get(), [](dds_entity_t, void* arg) { events_of(arg).notifier.notify(); });
  dds_lset_subscription_matched(l.get(),
                                [](dds_entity_t, dds_subscription_matched_status_t status, void* arg) {
                                  events_of(arg).matched = static_cast<int>(status.current_count);
                                });
  dds_lset_publication_matched(l.get(), [](dds_entity_t, dds_publication_matched_status_t status, void* arg) {
    events_of(arg).matched = static_cast<int>(status.current_count);
  });
  dds_lset_requested_incompatible_qos(
      l.get(), [](dds_entity_t, dds_requested_incompatible_qos_status_t status, void* arg) {
        events_of(arg).incompatible_with(status.last_policy_id, status.total_count_change);
      });
  dds_lset_offered_incompatible_qos(
      l.get(), [](dds_entity_t, dds_offered_incompatible_qos_status_t status, void* arg) {
        events_of(arg).incompatible_with(status.last_policy_id, status.total_count_change);
      });
  dds_lset_sample_lost(l.get(), [](dds_entity_t, dds_sample_lost_status_t status, void* arg) {
    events_of(arg).lost += static_cast<std::uint64_t>(std::max(status.total_count_change, 0));
  });
  return l;
}

Qos qos_for(const Topic& topic, bool writes, int depth) {
  const bool latched = topic.delivery == Delivery::latched;
  Qos q(dds_create_qos());
  dds_qset_reliability(q.get(), DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_durability(q.get(), latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(q.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_resource_limits(q.get(), kMaxInstances * depth, kMaxInstances, depth);
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
  int matched() const override { return events_.matched; }
  Counters counters() const override { return {samples_, 0, refused_, events_.incompatible}; }

 private:
  const Topic& topic_;
  const dds_entity_t writer_;
  Events& events_;
  std::uint64_t samples_ = 0, refused_ = 0;
};

class CycloneReader final : public Reader {
 public:
  CycloneReader(const Topic& topic, dds_entity_t reader, Events& events)
      : topic_(topic), reader_(reader), events_(events) {}
  ~CycloneReader() override {
    dds_set_listener(reader_, nullptr);
    dds_delete(reader_);
  }

  bool take(Payload& payload) override {
    ddsi_serdata* data = nullptr;
    dds_sample_info_t info;
    while (dds_takecdr(reader_, &data, 1, &info, DDS_ANY_STATE) == 1) {
      const bool good = info.valid_data && copy(*static_cast<const cyclone::Sample*>(data), payload);
      ddsi_serdata_unref(data);
      if (good) return true;
    }
    return false;
  }
  int matched() const override { return events_.matched; }
  Counters counters() const override { return {samples_, events_.lost, refused_, events_.incompatible}; }

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
  std::uint64_t samples_ = 0, refused_ = 0;
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
    return participant_;
  }

  std::unique_ptr<Writer> writer(const Topic& topic) override {
    Events& events = make_events(topic, true);
    const dds_entity_t made =
        dds_create_writer(participant_, topic_for(topic),
                          qos_for(topic, true, depth_of(topic.delivery)).get(), listener_for(events).get());
    return std::make_unique<CycloneWriter>(topic, checked(made, "writer", topic), events);
  }

  std::unique_ptr<Reader> reader(const Topic& topic, int depth) override {
    Events& events = make_events(topic, false);
    if (depth <= 0) depth = depth_of(topic.delivery);
    const dds_entity_t made = dds_create_reader(
        participant_, topic_for(topic), qos_for(topic, false, depth).get(), listener_for(events).get());
    return std::make_unique<CycloneReader>(topic, checked(made, "reader", topic), events);
  }

  bool wait(std::chrono::steady_clock::time_point deadline) override { return notifier_.wait(deadline); }
  void wake() noexcept override { notifier_.notify(); }
  const NodeOptions& options() const override { return options_; }

 private:
  Events& make_events(const Topic& topic, bool writes) {
    events_.push_back(std::make_unique<Events>(topic, options_, notifier_, writes));
    return *events_.back();
  }

  dds_entity_t topic_for(const Topic& topic) {
    dds_entity_t& made = topics_[topic.name];
    if (made <= 0) made = checked(cyclone::create_topic(participant_, topic), "topic", topic);
    return made;
  }

  const NodeOptions options_;
  const std::shared_ptr<Domain> domain_;
  Notifier notifier_;
  std::vector<std::unique_ptr<Events>> events_;  // until the participant is gone
  std::map<std::string_view, dds_entity_t> topics_;
  dds_entity_t participant_ = 0;
};

}  // namespace

Result<std::unique_ptr<Node>, Problem> open_cyclonedds(const NodeOptions& options) {
  LastWords::get();
  const auto interface = find_interface(options.interface_name);
  if (!interface) return interface.error();
  if (const auto peers = check_peers(options.peers); !peers) return peers.error();
  auto domain = Domain::of(options, interface.value());
  if (!domain) return domain.error();
  auto node = std::make_unique<CycloneNode>(options, std::move(domain).value());
  if (const dds_return_t made = node->start(); made < 0)
    return Problem{"domain", "= " + std::to_string(options.domain) + ", " + refusal(made)};
  return std::unique_ptr<Node>(std::move(node));
}

}  // namespace hamel::bus
