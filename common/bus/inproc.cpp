/// The bus within one process: the same bytes and the same delivery as over DDS, without threads or sockets.
///
///   Space (one per domain) -> Channel (one per topic) -> Inbox (one per reader), Outlet (one per writer)
///
/// One mutex per channel, held for copies only: a writer never waits for a reader's work.  Once the queues
/// have been as long as they get, nothing allocates.

#include <algorithm>
#include <atomic>
#include <cstring>
#include <list>
#include <map>
#include <mutex>
#include <unordered_map>

#include "common/bus/backends.h"
#include "common/bus/notifier.h"
#include "common/bus/payload.h"

namespace hamel::bus {
namespace {

/// The samples that wait for one reader, oldest first, at most `depth` of each key.
class Inbox {
 public:
  Inbox(const Topic& topic, int depth, Notifier& notifier)
      : depth_(depth > 0 ? depth : depth_of(topic.delivery)),
        counts_loss_(topic.delivery == Delivery::stream || depth > 1),
        notifier_(notifier) {}

  void push(std::uint32_t key, std::span<const std::byte> payload, const WriterId& from) {
    int& waiting = waiting_[key];
    if (waiting == depth_) {
      drop_oldest(key);
    } else {
      ++waiting;
    }
    if (spare_.empty()) spare_.emplace_back();
    queue_.splice(queue_.end(), spare_, spare_.begin());
    queue_.back().key = key;
    queue_.back().from = from;
    queue_.back().payload.assign(payload.begin(), payload.end());
    notifier_.notify();
  }

  bool pop(Payload& payload) {
    if (queue_.empty()) return false;
    Sample& oldest = queue_.front();
    std::swap(payload, oldest.payload);
    from_ = oldest.from;
    --waiting_[oldest.key];
    spare_.splice(spare_.end(), queue_, queue_.begin());
    ++counters_.samples;
    return true;
  }

  const Counters& counters() const { return counters_; }
  const WriterId& from() const { return from_; }
  void count_disposed() { ++counters_.disposed; }

 private:
  struct Sample {
    std::uint32_t key = 0;
    WriterId from{};
    Payload payload;
  };

  void drop_oldest(std::uint32_t key) {
    const auto oldest =
        std::find_if(queue_.begin(), queue_.end(), [key](const Sample& s) { return s.key == key; });
    spare_.splice(spare_.end(), queue_, oldest);
    if (counts_loss_) ++counters_.lost;  // a latched sample is meant to be replaced
  }

  const int depth_;
  const bool counts_loss_;
  Notifier& notifier_;
  std::list<Sample> queue_, spare_;
  std::unordered_map<std::uint32_t, int> waiting_;
  WriterId from_{};
  Counters counters_;
};

/// What one writer of a latched topic keeps for readers to come: the last sample of each key.
struct Outlet {
  WriterId id{};
  std::string participant;
  std::map<std::uint32_t, Payload> last;
};

/// Writers of this process, numbered.
WriterId next_id() {
  static std::atomic<std::uint64_t> count{0};
  const std::uint64_t number = ++count;
  WriterId id{};
  std::memcpy(id.data(), &number, sizeof number);
  return id;
}

struct Channel {
  const Topic* topic = nullptr;
  std::mutex mutex;
  std::list<Inbox*> inboxes;
  std::list<Outlet*> outlets;
};

/// All channels of one domain.
class Space {
 public:
  /// The space of a domain; it lives as long as a node does.
  static std::shared_ptr<Space> of(std::uint32_t domain) {
    static std::mutex mutex;
    static std::map<std::uint32_t, std::weak_ptr<Space>> spaces;
    std::lock_guard lock(mutex);
    auto space = spaces[domain].lock();
    if (!space) spaces[domain] = space = std::make_shared<Space>();
    return space;
  }

  Channel& channel(const Topic& topic) {
    std::lock_guard lock(mutex_);
    Channel& channel = channels_[topic.name];
    channel.topic = &topic;
    return channel;
  }

  std::vector<Endpoint> endpoints() {
    std::lock_guard lock(mutex_);
    std::vector<Endpoint> all;
    for (auto& [name, channel] : channels_) {
      std::lock_guard inner(channel.mutex);
      Endpoint e{.topic = std::string(name),
                 .type = std::string(channel.topic->type),
                 .reliable = true,
                 .latched = channel.topic->delivery == Delivery::latched};
      all.insert(all.end(), channel.inboxes.size(), e);
      e.writes = true;
      for (const Outlet* outlet : channel.outlets) {
        e.id = outlet->id;
        e.participant = outlet->participant;
        all.push_back(e);
      }
    }
    return all;
  }

 private:
  std::mutex mutex_;
  std::map<std::string_view, Channel> channels_;
};

class InprocWriter final : public Writer {
 public:
  InprocWriter(const Topic& topic, Channel& channel, const std::string& participant)
      : topic_(topic), channel_(channel), outlet_{next_id(), participant, {}} {
    std::lock_guard lock(channel_.mutex);
    channel_.outlets.push_back(&outlet_);
  }
  ~InprocWriter() override {
    std::lock_guard lock(channel_.mutex);
    channel_.outlets.remove(&outlet_);
  }

  bool write(std::span<const std::byte> payload) override {
    std::lock_guard lock(channel_.mutex);
    if (!acceptable(payload, topic_)) {
      ++counters_.refused;
      return false;
    }
    const std::uint32_t key = topic_.keyed ? key_of(payload) : 0;
    for (Inbox* inbox : channel_.inboxes) inbox->push(key, payload, outlet_.id);
    if (topic_.delivery == Delivery::latched) outlet_.last[key].assign(payload.begin(), payload.end());
    ++counters_.samples;
    return true;
  }
  bool dispose(std::span<const std::byte> payload) override {
    std::lock_guard lock(channel_.mutex);
    if (!acceptable(payload, topic_)) return false;
    outlet_.last.erase(topic_.keyed ? key_of(payload) : 0);
    for (Inbox* inbox : channel_.inboxes) inbox->count_disposed();
    return true;
  }
  WriterId id() const override { return outlet_.id; }
  int matched() const override {
    std::lock_guard lock(channel_.mutex);
    return static_cast<int>(channel_.inboxes.size());
  }
  Counters counters() const override {
    std::lock_guard lock(channel_.mutex);
    return counters_;
  }

 private:
  const Topic& topic_;
  Channel& channel_;
  Outlet outlet_;
  Counters counters_;
};

class InprocReader final : public Reader {
 public:
  InprocReader(const Topic& topic, int depth, Channel& channel, Notifier& notifier)
      : inbox_(topic, depth, notifier), channel_(channel) {
    std::lock_guard lock(channel_.mutex);
    for (const Outlet* outlet : channel_.outlets)
      for (const auto& [key, payload] : outlet->last) inbox_.push(key, payload, outlet->id);
    channel_.inboxes.push_back(&inbox_);
  }
  ~InprocReader() override {
    std::lock_guard lock(channel_.mutex);
    channel_.inboxes.remove(&inbox_);
  }

  bool take(Payload& payload) override {
    std::lock_guard lock(channel_.mutex);
    return inbox_.pop(payload);
  }
  WriterId from() const override { return inbox_.from(); }
  int matched() const override {
    std::lock_guard lock(channel_.mutex);
    return static_cast<int>(channel_.outlets.size());
  }
  Counters counters() const override {
    std::lock_guard lock(channel_.mutex);
    return inbox_.counters();
  }

 private:
  Inbox inbox_;
  Channel& channel_;
};

class InprocNode final : public Node {
 public:
  explicit InprocNode(const NodeOptions& options) : options_(options), space_(Space::of(options.domain)) {}

  std::unique_ptr<Writer> writer(const Topic& topic) override {
    return std::make_unique<InprocWriter>(topic, space_->channel(topic), options_.name);
  }
  std::unique_ptr<Reader> reader(const Topic& topic, int depth, Ask) override {
    return std::make_unique<InprocReader>(topic, depth, space_->channel(topic), notifier_);
  }
  std::vector<Endpoint> endpoints() override { return space_->endpoints(); }
  std::uint64_t incompatible() const override { return 0; }
  std::string complaint() const override { return {}; }
  bool wait(std::chrono::steady_clock::time_point deadline) override { return notifier_.wait(deadline); }
  void wake() noexcept override { notifier_.notify(); }
  const NodeOptions& options() const override { return options_; }

 private:
  NodeOptions options_;
  std::shared_ptr<Space> space_;
  Notifier notifier_;
};

}  // namespace

Result<std::unique_ptr<Node>, Problem> open_inproc(const NodeOptions& options) {
  return std::unique_ptr<Node>(std::make_unique<InprocNode>(options));
}

}  // namespace hamel::bus
