#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "clients/hamel/record.h"
#include "common/record/reader.h"
#include "common/runtime/log.h"
#include "common/runtime/loop.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Clock = runtime::Clock;

namespace {

/// How late messages went out.
struct Lateness {
  std::uint64_t count = 0;
  double sum_s = 0, worst_s = 0;
  void add(double late_s) {
    ++count;
    sum_s += late_s;
    worst_s = std::max(worst_s, late_s);
  }
};

class Player {
 public:
  Player(bus::Node& node, record::IndexedReader& in, const PlayArgs& args, runtime::StopSignal& stop)
      : node_(node), in_(in), args_(args), stop_(stop) {
    query_.begin = static_cast<std::uint64_t>(std::max(0.0, args.begin_s) * 1e9);
    if (args.end_s >= 0) query_.end = static_cast<std::uint64_t>(args.end_s * 1e9);
    for (const std::string& name : args.topics) {
      const Topic* topic = find_topic(name);
      query_.topics.emplace(topic->name);
      for (const auto& [id, channel] : in.summary().channels)
        if (channel.topic == topic->name) writers_[id] = node.writer(*topic);
    }
  }

  /// Waits until every topic has a reader, or for five seconds.
  void await_readers() {
    const auto deadline = Clock::now() + 5s;
    const auto alone = [](const auto& w) { return w.second->matched() == 0; };
    while (std::any_of(writers_.begin(), writers_.end(), alone) && Clock::now() < deadline &&
           !stop_.requested())
      node_.wait(Clock::now() + 10ms);
    if (node_.options().vendor != bus::Vendor::inproc) wait_until(Clock::now() + 200ms);
  }

  /// False when it was stopped before the end.
  bool play_once() {
    in_.seek(query_);
    const auto began = Clock::now();
    std::optional<std::uint64_t> first;
    while (const auto item = in_.next()) {
      if (const auto* d = std::get_if<record::Damage>(&*item)) {
        spdlog::warn("{}: at byte {}: {}", args_.path, d->offset, d->what);
        continue;
      }
      const auto& m = std::get<record::Message>(*item);
      if (!first) first = args_.begin_s > 0 ? query_.begin : m.log_time;
      const double after_s = static_cast<double>(m.log_time - *first) * 1e-9 / args_.rate;
      const auto due =
          began + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(after_s));
      if (!wait_until(due)) return false;
      writers_[m.channel]->write(m.data);
      lateness.add(std::chrono::duration<double>(Clock::now() - due).count());
    }
    return !stop_.requested();
  }

  Lateness lateness;

 private:
  bool wait_until(Clock::time_point due) {
    while (!stop_.requested() && Clock::now() < due) node_.wait(due);
    return !stop_.requested();
  }

  bus::Node& node_;
  record::IndexedReader& in_;
  const PlayArgs& args_;
  runtime::StopSignal& stop_;
  record::Query query_;
  std::map<std::uint16_t, std::unique_ptr<bus::Writer>> writers_;
};

}  // namespace

int play(const PlayArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  for (const std::string& name : args.topics)
    if (find_topic(name) == nullptr)
      return runtime::complain("hamel play", {{"--topic " + name, "is no topic of hamel"}});
  auto file = record::IndexedReader::open(args.path);
  if (!file) return runtime::complain("hamel play", {file.error()});
  auto node = runtime::open_node(args.bus, "", "hamel-play");
  if (!node) return runtime::complain("hamel play", {node.error()});
  bus::Node& n = *node.value();
  stop.on_stop([&n] { n.wake(); });
  Player player(n, file.value(), args, stop);
  player.await_readers();
  bool whole = false;
  do {
    const std::uint64_t before = player.lateness.count;
    whole = player.play_once();
    if (player.lateness.count == before) break;  // nothing there: no use in beginning anew
  } while (args.loop && whole);
  stop.on_stop({});
  runtime::linger(n);
  const Lateness& l = player.lateness;
  if (l.count == 0) {
    fmt::print(stderr, "hamel play: {}: holds no such message\n", args.path);
    return runtime::kNoData;
  }
  fmt::print(stderr, "{}: {} messages, late by {:.0f} us on average, {:.0f} us at most\n", args.path, l.count,
             l.sum_s / static_cast<double>(l.count) * 1e6, l.worst_s * 1e6);
  return whole || args.loop ? runtime::kDone : runtime::kInterrupted;
}

}  // namespace hamel::client
