#include "clients/hamel/bench_bus.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numeric>

#include "clients/hamel/bench_lockstep.h"
#include "clients/hamel/bench_ping.h"
#include "clients/hamel/shipped.h"

namespace hamel::client {

using namespace ping;
using Json = nlohmann::ordered_json;

namespace {

Json row(const std::string& name, int processes, Times& t) {
  return {{"pair", name},
          {"processes", processes},
          {"one_way_p50_us", quantile(t.there_us, 0.5)},
          {"one_way_p99_us", quantile(t.there_us, 0.99)},
          {"one_way_p999_us", quantile(t.there_us, 0.999)},
          {"one_way_max_us", quantile(t.there_us, 1)},
          {"round_p50_us", quantile(t.round_us, 0.5)},
          {"round_p99_us", quantile(t.round_us, 0.99)},
          {"round_p999_us", quantile(t.round_us, 0.999)},
          {"round_max_us", quantile(t.round_us, 1)},
          {"lost", t.lost}};
}

std::string pair_name(Vendor a, Vendor b) {
  return a == b ? to_string(a) : std::string(to_string(a)) + " - " + to_string(b);
}

Json between_processes(Vendor a, Vendor b, const BenchBusArgs& args) {
  const Child other(other_process(b, args.domain));
  Asker asker(a, args.domain);
  if (!asker.wait_for_match(10s))
    throw std::runtime_error(pair_name(a, b) + ": the two processes do not meet");
  auto times = measure(args.samples, args.rate_hz, [&](Stamp& s) { return asker.ask(s, 200ms); });
  return row(pair_name(a, b), 2, times);
}

Json within_process(Vendor a, Vendor b, const BenchBusArgs& args) {
  std::atomic<bool> stop{false};
  std::thread other([&] { answer(b, args.domain, stop); });
  Times times;
  {
    Asker asker(a, args.domain);
    if (asker.wait_for_match(10s))
      times = measure(args.samples, args.rate_hz, [&](Stamp& s) { return asker.ask(s, 200ms); });
    else
      times.lost = args.samples;
  }
  stop = true;
  other.join();
  return row(pair_name(a, b), 1, times);
}

/// The answering process is killed and started again: from the start to its first answer.
Json restart(Vendor a, Vendor b, const BenchBusArgs& args) {
  Asker asker(a, args.domain);
  std::vector<double> ms;
  std::int64_t number = 0;
  for (int i = 0; i < 6; ++i) {
    const auto began = Clock::now();
    const Child other(other_process(b, args.domain));
    Stamp s;
    do {
      s = Stamp();
      s.number = ++number;
    } while (!asker.ask(s, 2ms) && Clock::now() - began < 10s);
    if (i > 0) ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
  }
  return {{"pair", pair_name(a, b)},
          {"bound_ms", a == b ? 1000 : 2000},
          {"median_ms", quantile(ms, 0.5)},
          {"longest_ms", quantile(ms, 1)}};
}

int udp_socket(sockaddr_in& address) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), length) != 0) throw std::runtime_error("no UDP socket");
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  const timeval limit{0, 200000};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  return fd;
}

/// The floor: the same over bare blocking sockets.
Times bare_udp(int samples, double rate_hz) {
  sockaddr_in here, there;
  const int a = udp_socket(here), b = udp_socket(there);
  const Child other([&] {
    Payload p(kBytes);
    while (true) {
      if (recv(b, p.data(), p.size(), 0) <= 0) continue;
      Stamp s = get(p);
      s.answered_ns = now_ns();
      put(s, p);
      sendto(b, p.data(), p.size(), 0, reinterpret_cast<const sockaddr*>(&here), sizeof here);
    }
  });
  Payload p;
  auto times = measure(samples, rate_hz, [&](Stamp& s) {
    put(s, p);
    sendto(a, p.data(), p.size(), 0, reinterpret_cast<const sockaddr*>(&there), sizeof there);
    while (recv(a, p.data(), p.size(), 0) > 0)
      if (get(p).number == s.number) {
        s = get(p);
        return true;
      }
    return false;
  });
  close(a);
  close(b);
  return times;
}

/// How late a 1 kHz loop wakes in Node::wait(), with and without a process that keeps a processor busy.
Json jitter(bool busy, const BenchBusArgs& args) {
  std::unique_ptr<Child> load;
  if (busy)
    load = std::make_unique<Child>([] {
      for (std::atomic<unsigned> i = 0;; ++i) {
      }
    });
  const auto node = open(bus::kDefaultNetworkVendor, args.domain);
  std::vector<double> late_us;
  int missed = 0;
  auto next = Clock::now();
  for (int i = 0; i < args.samples; ++i) {
    next += 1ms;
    while (Clock::now() < next) node->wait(next);
    const double late = std::chrono::duration<double, std::micro>(Clock::now() - next).count();
    late_us.push_back(late);
    if (late < 1000) continue;
    missed += static_cast<int>(late / 1000);
    next = Clock::now();
  }
  return {{"busy", busy},
          {"late_p50_us", quantile(late_us, 0.5)},
          {"late_p99_us", quantile(late_us, 0.99)},
          {"late_max_us", quantile(late_us, 1)},
          {"deadlines_missed", missed}};
}

Json lockstep(Vendor vendor, int processes, const std::string& scene, const BenchBusArgs& args) {
  const auto flat_out = [&] {
    const Times t = bare_udp(args.samples, 0);
    return std::accumulate(t.round_us.begin(), t.round_us.end(), 0.0) /
           static_cast<double>(t.round_us.size());
  };
  const LockstepRate r = lockstep_rate(vendor, args.domain, scene, processes, flat_out);
  const double bus_us = std::max(r.step_us - r.tick_us, 1e-3);
  return {{"bus", to_string(vendor)},
          {"processes", r.processes},
          {"steps_per_s", 1e6 / r.step_us},
          {"tick_us", r.tick_us},
          {"bus_us_per_step", bus_us},
          {"udp_round_us", r.udp_round_us},
          {"of_what_udp_allows", r.udp_round_us / bus_us}};
}

constexpr Vendor kFast = Vendor::fastdds, kCyclone = Vendor::cyclonedds;
constexpr std::pair<Vendor, Vendor> kPairs[] = {
    {kFast, kFast}, {kCyclone, kCyclone}, {kFast, kCyclone}, {kCyclone, kFast}};

void latency(const BenchBusArgs& args, Json& rows) {
  auto udp = bare_udp(args.samples, args.rate_hz);
  rows.push_back(row("UDP", 2, udp));
  rows.push_back(within_process(Vendor::inproc, Vendor::inproc, args));
  for (const auto& [a, b] : kPairs) rows.push_back(within_process(a, b, args));
  for (const auto& [a, b] : kPairs) rows.push_back(between_processes(a, b, args));
}

void lockstep(const BenchBusArgs& args, Json& rows) {
  const std::string scene = shipped_scene("four_link_avoid");
  if (scene.empty()) {
    fmt::print(stderr, "hamel bench bus: four_link_avoid is not installed: no lockstep\n");
    return;
  }
  for (const Vendor v : {kFast, kCyclone})
    for (const int processes : {2, 3}) rows.push_back(lockstep(v, processes, scene, args));
}

void print(const Json& all) {
  fmt::print("{} bytes at {} Hz, microseconds\n", kBytes, all["rate_hz"].get<double>());
  fmt::print("{:<26} {:>5} {:>8} {:>8} {:>8} {:>9} {:>10} {:>8} {:>8} {:>9} {:>5}\n", "", "proc", "one way",
             "p99", "p99.9", "max", "round trip", "p99", "p99.9", "max", "lost");
  const auto us = [](const Json& r, const char* key) { return r[key].get<double>(); };
  for (const auto& r : all["latency"])
    fmt::print(
        "{:<26} {:>5} {:>8.1f} {:>8.1f} {:>8.1f} {:>9.1f} {:>10.1f} {:>8.1f} {:>8.1f} {:>9.1f} {:>5}\n",
        r["pair"].get<std::string>(), r["processes"].get<int>(), us(r, "one_way_p50_us"),
        us(r, "one_way_p99_us"), us(r, "one_way_p999_us"), us(r, "one_way_max_us"), us(r, "round_p50_us"),
        us(r, "round_p99_us"), us(r, "round_p999_us"), us(r, "round_max_us"), r["lost"].get<int>());
  for (const auto& r : all["restart"])
    fmt::print("{:<26} back after kill -9: median {:.0f} ms, longest {:.0f} ms\n",
               r["pair"].get<std::string>(), us(r, "median_ms"), us(r, "longest_ms"));
  for (const auto& r : all["loop"])
    fmt::print("1 kHz loop{:<16} late p50 {:.0f}, p99 {:.0f}, max {:.0f}; {} deadlines missed\n",
               r["busy"].get<bool>() ? ", one core busy" : "", us(r, "late_p50_us"), us(r, "late_p99_us"),
               us(r, "late_max_us"), r["deadlines_missed"].get<int>());
  for (const auto& r : all["lockstep"])
    fmt::print(
        "lockstep over {:<12} {:.0f} steps/s in {} processes: {:.0f} us of ticks, {:.0f} us of bus where "
        "UDP's "
        "round trip takes {:.0f}: {:.2f} of what that allows\n",
        r["bus"].get<std::string>(), us(r, "steps_per_s"), r["processes"].get<int>(), us(r, "tick_us"),
        us(r, "bus_us_per_step"), us(r, "udp_round_us"), us(r, "of_what_udp_allows"));
}

bool passes(const Json& all) {
  bool good = true;
  for (const auto& r : all["latency"]) good &= r["lost"].get<int>() == 0;
  for (const auto& r : all["restart"]) good &= r["longest_ms"].get<double>() <= r["bound_ms"].get<double>();
  for (const auto& r : all["lockstep"]) good &= r["of_what_udp_allows"].get<double>() >= 0.5;
  return good;
}

}  // namespace

int bench_bus(const BenchBusArgs& args) {
  if (!args.answer.empty()) {
    const auto vendor = bus::vendor_from(args.answer);
    if (!vendor) return runtime::kBadInput;
    answer(vendor.value(), args.domain, std::atomic<bool>(false));
  }
  if (const auto p = runtime::go_realtime({.cpu = args.cpu}); !p.empty())
    return runtime::complain("hamel bench bus", p);
  Json all{{"rate_hz", args.rate_hz}, {"samples", args.samples}, {"cpu", args.cpu}};
  for (const char* part : {"latency", "restart", "loop", "lockstep"}) all[part] = Json::array();
  const auto wanted = [&](const char* part) { return args.only.empty() || args.only == part; };
  if (wanted("latency")) latency(args, all["latency"]);
  if (wanted("restart"))
    for (const auto& [a, b] : kPairs) all["restart"].push_back(restart(a, b, args));
  if (wanted("loop"))
    for (const bool busy : {false, true}) all["loop"].push_back(jitter(busy, args));
  if (wanted("lockstep")) lockstep(args, all["lockstep"]);
  if (args.json)
    fmt::print("{}\n", all.dump(1));
  else
    print(all);
  return !args.check || passes(all) ? runtime::kDone : runtime::kFailed;
}

}  // namespace hamel::client
