#include "clients/hamel/topic.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <unordered_set>

#include "clients/hamel/timing.h"
#include "common/runtime/loop.h"
#include "common/runtime/signals.h"
#include "common/wire/endpoint.h"
#include "common/wire/fields.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

constexpr auto kMatch = 1200ms;  // a match between vendors may take a second
constexpr const char* kPrefix = "hamel/v1/";

const Topic* find(const std::string& name) {
  for (const Topic& t : kTopics)
    if (t.name == name || t.name == kPrefix + name) return &t;
  return nullptr;
}

int no_topic(const char* verb, const std::string& name) {
  std::string names;
  for (const Topic& t : kTopics)
    names += (names.empty() ? "" : ", ") + std::string(t.name.substr(std::string_view(kPrefix).size()));
  return runtime::complain(std::string("hamel topic ") + verb, {{name, "is no topic; there are " + names}});
}

/// The key of a payload that decodes: its first field.
std::uint32_t key_of(const bus::Payload& p) {
  std::uint32_t key = 0;
  for (std::size_t i = 0; i < 4 && p.size() >= 8; ++i)
    key |= std::to_integer<std::uint32_t>(p[4 + (p[1] == std::byte{1} ? i : 3 - i)]) << (8 * i);
  return key;
}

std::string show(const wire::Field& f) {
  if (const auto* u = std::get_if<std::uint64_t>(&f.value)) return std::to_string(*u);
  if (const auto* d = std::get_if<double>(&f.value)) return fmt::format("{:.9g}", *d);
  if (const auto* b = std::get_if<bool>(&f.value)) return *b ? "true" : "false";
  if (const auto* s = std::get_if<std::string>(&f.value))
    return "\"" + (s->size() > 200 ? s->substr(0, 200) + "..." : *s) + "\"";
  return "[]";
}

nlohmann::ordered_json json_of(const wire::Field& f) {
  return std::visit(
      [](const auto& v) -> nlohmann::ordered_json {
        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, wire::EmptyList>)
          return nlohmann::ordered_json::array();
        else if constexpr (std::is_same_v<std::decay_t<decltype(v)>, double>)
          return std::isfinite(v) ? nlohmann::ordered_json(v) : nlohmann::ordered_json(nullptr);
        else
          return v;
      },
      f.value);
}

std::string qos(const bus::Endpoint& e) {
  return std::string(e.reliable ? "reliable" : "best-effort") + (e.latched ? " latched" : "") +
         (e.exclusive ? " exclusive" : "");
}

/// How often a topic speaks, over the time it was listened to.
struct Pulse {
  const Topic* topic = nullptr;
  std::unique_ptr<bus::Reader> reader;
  std::uint64_t messages = 0, bytes = 0, broken = 0;
  std::string last_broken;
  Clock::time_point first{}, last{};
  std::vector<double> gaps_ms;

  void hear(const bus::Payload& p, Clock::time_point now) {
    if (messages++ == 0)
      first = now;
    else
      gaps_ms.push_back(std::chrono::duration<double, std::milli>(now - last).count());
    last = now;
    bytes += p.size();
    if (const auto fields = wire::fields(*topic, p); !fields) {
      ++broken;
      last_broken = std::string(fields.error().field) + " " + fields.error().rule;
    }
  }
  double rate_hz() const {
    const double s = std::chrono::duration<double>(last - first).count();
    return messages > 1 && s > 0 ? static_cast<double>(messages - 1) / s : 0;
  }
};

}  // namespace

int topic_list(const TopicArgs& args) {
  auto node = runtime::open_node(args.bus, "", "hamel-topic");
  if (!node) return runtime::complain("hamel topic list", {node.error()});
  const auto deadline = Clock::now() + std::max<Clock::duration>(kMatch, runtime::seconds(args.seconds));
  while (Clock::now() < deadline) node.value()->wait(deadline);
  std::map<std::string, std::vector<bus::Endpoint>> topics;
  for (auto& e : node.value()->endpoints()) topics[e.topic].push_back(e);
  if (args.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const auto& [name, ends] : topics) {
      nlohmann::ordered_json each = nlohmann::ordered_json::array();
      for (const auto& e : ends)
        each.push_back(
            {{"participant", e.participant}, {"writes", e.writes}, {"qos", qos(e)}, {"type", e.type}});
      list.push_back({{"topic", name}, {"ends", each}});
    }
    fmt::print("{}\n", nlohmann::ordered_json{{"topics", list}}.dump(2));
  }
  for (const auto& [name, ends] : topics) {
    if (args.json) break;
    const Topic* known = find(name);
    fmt::print("{}  {}{}\n", name, ends.front().type, known ? "" : "  (not one of ours)");
    for (const auto& e : ends)
      fmt::print("  {} {:<20} {}{}\n", e.writes ? "writes" : "reads ",
                 e.participant.empty() ? "?" : e.participant, qos(e),
                 e.type == ends.front().type ? "" : "  OTHER TYPE " + e.type);
  }
  if (!topics.empty()) return runtime::kDone;
  fmt::print(stderr, "hamel topic list: nobody is on domain {}\n", args.bus.domain);
  return runtime::kNoData;
}

int topic_echo(const TopicArgs& args) {
  runtime::StopSignal stop;
  const Topic* topic = find(args.topic);
  if (topic == nullptr) return no_topic("echo", args.topic);
  auto node = runtime::open_node(args.bus, "", "hamel-topic");
  if (!node) return runtime::complain("hamel topic echo", {node.error()});
  bus::Node& n = *node.value();
  stop.on_stop([&n] { n.wake(); });
  const auto reader = n.reader(*topic, 0, bus::Ask::glimpse);
  const auto deadline = Clock::now() + runtime::seconds(args.seconds);
  bus::Payload p;
  std::uint64_t shown = 0;
  int written = 0;
  while (written == 0 && !stop.requested() && (args.count == 0 || shown < args.count)) {
    if (!reader->take(p)) {
      if (shown == 0 && Clock::now() > deadline) break;
      n.wait(Clock::now() + 100ms);
      continue;
    }
    if (args.arm && topic->keyed && key_of(p) != *args.arm) continue;
    ++shown;
    const auto fields = wire::fields(*topic, p);
    if (!fields) {
      fmt::print("# {} bytes that do not decode: {} {}\n", p.size(), fields.error().field,
                 fields.error().rule);
    } else if (args.json) {
      nlohmann::ordered_json j;
      for (const auto& f : fields.value()) j[f.path] = json_of(f);
      fmt::print("{}\n", j.dump());
    } else {
      for (const auto& f : fields.value()) fmt::print("{}: {}\n", f.path, show(f));
      fmt::print("---\n");
    }
    if (std::fflush(stdout) != 0) written = errno;
  }
  stop.on_stop({});
  if (written != 0 && written != EPIPE)
    return runtime::complain("hamel topic echo", {{"standard output", std::strerror(written)}});
  if (shown > 0) return runtime::kDone;
  fmt::print(stderr, "hamel topic echo: nothing on {} within {} s on domain {}\n", topic->name, args.seconds,
             args.bus.domain);
  return runtime::kNoData;
}

int topic_hz(const TopicArgs& args) {
  auto node = runtime::open_node(args.bus, "", "hamel-topic");
  if (!node) return runtime::complain("hamel topic hz", {node.error()});
  bus::Node& n = *node.value();
  std::vector<Pulse> pulses;
  for (const Topic& t : kTopics) {
    if (!args.topic.empty() && find(args.topic) != &t) continue;
    pulses.emplace_back();
    pulses.back().topic = &t;
    pulses.back().reader = n.reader(t, 0, bus::Ask::promises);
  }
  if (pulses.empty()) return no_topic("hz", args.topic);
  const auto deadline = Clock::now() + runtime::seconds(args.seconds);
  bus::Payload p;
  while (Clock::now() < deadline) {
    for (Pulse& pulse : pulses)
      while (pulse.reader->take(p)) pulse.hear(p, Clock::now());
    n.wait(deadline);
  }
  bool any = false;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  if (!args.json)
    fmt::print("{:<11} {:>9} {:>9} {:>10} {:>10} {:>8} {:>6} {:>7} {:>7}\n", "topic", "Hz", "promised",
               "gap p99 ms", "gap max ms", "kB/s", "lost", "late", "broken");
  for (Pulse& pulse : pulses) {
    any |= pulse.messages > 0;
    if (pulse.messages == 0 && args.topic.empty()) continue;
    const auto c = pulse.reader->counters();
    const std::string name(pulse.topic->name.substr(std::string_view(kPrefix).size()));
    const double p99 = quantile(pulse.gaps_ms, 0.99), most = quantile(pulse.gaps_ms, 1);
    const double kB = static_cast<double>(pulse.bytes) * 1e-3 / args.seconds;
    if (args.json)
      list.push_back({{"topic", name},
                      {"messages", pulse.messages},
                      {"rate_hz", pulse.rate_hz()},
                      {"promised_hz", pulse.topic->rate_hz},
                      {"gap_p99_ms", p99},
                      {"gap_max_ms", most},
                      {"kB_per_s", kB},
                      {"lost", c.lost},
                      {"late", c.late},
                      {"silent", c.silent},
                      {"broken", pulse.broken + c.refused},
                      {"writers", pulse.reader->matched()}});
    else
      fmt::print("{:<11} {:>9.1f} {:>9.0f} {:>10.2f} {:>10.2f} {:>8.1f} {:>6} {:>7} {:>7}{}\n", name,
                 pulse.rate_hz(), pulse.topic->rate_hz, p99, most, kB, c.lost, c.late,
                 pulse.broken + c.refused, pulse.last_broken.empty() ? "" : "  (" + pulse.last_broken + ")");
  }
  if (args.json) fmt::print("{}\n", nlohmann::ordered_json{{"topics", list}}.dump(2));
  if (any) return runtime::kDone;
  fmt::print(stderr, "hamel topic hz: nothing came within {} s on domain {}\n", args.seconds,
             args.bus.domain);
  return runtime::kNoData;
}

int topic_latency(const TopicArgs& args) {
  auto node = runtime::open_node(args.bus, "", "hamel-topic");
  if (!node) return runtime::complain("hamel topic latency", {node.error()});
  bus::Node& n = *node.value();
  wire::Subscription<wire::ArmState> states(n);
  wire::Subscription<wire::TorqueCommand> commands(n);
  std::unordered_map<std::uint64_t, Clock::time_point> seen;
  std::unordered_set<std::uint64_t> early;  // commands that overtook their states on the way here
  std::vector<double> ms;
  std::uint64_t unanswered = 0;  // from the first answer on: before it the two ends had not met
  const auto answer = [&](std::uint64_t step, double after_ms) {
    if (ms.empty()) std::erase_if(seen, [step](const auto& state) { return state.first < step; });
    ms.push_back(after_ms);
  };
  wire::ArmState s;
  wire::TorqueCommand c;
  const std::uint32_t arm = args.arm.value_or(1);
  const auto deadline = Clock::now() + runtime::seconds(args.seconds);
  while (Clock::now() < deadline) {
    while (states.take(s)) {
      if (s.arm != arm) continue;
      if (seen.size() > 4096) unanswered += ms.empty() ? 0 : seen.size(), seen.clear();
      if (early.erase(s.step) > 0)
        answer(s.step, 0);
      else
        seen.try_emplace(s.step, Clock::now());
    }
    while (commands.take(c)) {
      if (c.arm != arm) continue;
      const auto asked = seen.find(c.step);
      if (asked == seen.end()) {
        if (early.size() > 4096) early.clear();
        early.insert(c.step);
        continue;
      }
      const double after_ms = std::chrono::duration<double, std::milli>(Clock::now() - asked->second).count();
      seen.erase(asked);
      answer(c.step, after_ms);
    }
    n.wait(deadline);
  }
  unanswered += seen.size();
  if (args.json)
    fmt::print("{}\n", nlohmann::ordered_json{{"arm", arm},
                                              {"answers", ms.size()},
                                              {"unanswered", unanswered},
                                              {"p50_ms", quantile(ms, 0.5)},
                                              {"p99_ms", quantile(ms, 0.99)},
                                              {"p999_ms", quantile(ms, 0.999)},
                                              {"max_ms", quantile(ms, 1)}}
                           .dump(2));
  else if (!ms.empty())
    fmt::print(
        "state to command, arm {}: p50 {:.3f} ms, p99 {:.3f}, p99.9 {:.3f}, max {:.3f}; {} answers, {} "
        "states "
        "without one\n",
        arm, quantile(ms, 0.5), quantile(ms, 0.99), quantile(ms, 0.999), quantile(ms, 1), ms.size(),
        unanswered);
  if (!ms.empty()) return runtime::kDone;
  fmt::print(stderr, "hamel topic latency: no command of arm {} answered a state within {} s on domain {}\n",
             arm, args.seconds, args.bus.domain);
  return runtime::kNoData;
}

}  // namespace hamel::client
