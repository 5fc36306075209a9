/// Latency of the bus between two processes on this host, and how fast it recovers from a kill -9.
///
///   hamel_bus_bench [samples [rate_hz]]
///
/// Process A writes a 400-byte sample on the state topic at a fixed rate; process B answers each with one on
/// the command topic; both block in Node::wait().  A sample carries its time on the monotonic clock, which
/// both share, so one way is measured as well as the round trip.  "udp" is the same over bare blocking
/// sockets: the floor.

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <vector>

#include "common/bus/bus.h"

namespace {

using namespace hamel;
using namespace std::chrono_literals;
using bus::Payload;
using bus::Vendor;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kBytes = 400;
constexpr std::uint32_t kDomain = 99;

std::int64_t now_ns() { return std::chrono::nanoseconds(Clock::now().time_since_epoch()).count(); }

/// Key 1, then number and two times.
struct Stamp {
  std::uint8_t header[4] = {0, 1, 0, 0};
  std::uint32_t key = 1;
  std::int64_t number = 0, sent_ns = 0, answered_ns = 0;
};
void put(const Stamp& s, Payload& p) {
  p.resize(kBytes);
  std::memcpy(p.data(), &s, sizeof s);
}
Stamp get(const Payload& p) {
  Stamp s;
  std::memcpy(&s, p.data(), sizeof s);
  return s;
}

std::unique_ptr<bus::Node> open(Vendor vendor) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = kDomain;
  auto node = bus::open(options);
  if (node) return std::move(node).value();
  std::fprintf(stderr, "%s\n", to_string(node.error()).c_str());
  std::exit(2);
}

/// Runs `work` in a child; the caller ends it by its number.
template <class Work>
pid_t in_child(Work work) {
  const pid_t child = fork();
  if (child != 0) return child;
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // nobody answers for ever
  work();
  _exit(0);
}
/// A process of its own that answers; executed anew, for nothing of a vendor's library survives a fork.
pid_t start_answering(Vendor vendor) {
  return in_child([&] { execl("/proc/self/exe", "hamel_bus_bench", "answer", to_string(vendor), nullptr); });
}
void kill_and_reap(pid_t child) {
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

[[noreturn]] void answer(Vendor vendor) {
  const auto node = open(vendor);
  const auto reader = node->reader(topics::kState);
  const auto writer = node->writer(topics::kCommand);
  Payload p;
  while (true) {
    node->wait(Clock::now() + 1s);
    while (reader->take(p)) {
      Stamp s = get(p);
      s.answered_ns = now_ns();
      put(s, p);
      writer->write(p);
    }
  }
}

struct Times {
  std::vector<double> there_us, round_us;
  int lost = 0;
};

double percentile(std::vector<double>& v, double q) {
  if (v.empty()) return 0;
  std::sort(v.begin(), v.end());
  return v[std::min(v.size() - 1, static_cast<std::size_t>(q * static_cast<double>(v.size())))];
}

void print(const char* name, Times& t) {
  std::printf("%-24s one way %6.1f %6.1f %7.1f   round trip %6.1f %6.1f %7.1f %8.1f   lost %d\n", name,
              percentile(t.there_us, 0.5), percentile(t.there_us, 0.99), percentile(t.there_us, 0.999),
              percentile(t.round_us, 0.5), percentile(t.round_us, 0.99), percentile(t.round_us, 0.999),
              percentile(t.round_us, 1), t.lost);
  std::fflush(stdout);
}

/// Asks `samples` times at `rate_hz`; `ask(stamp)` gives the answer, or false after its own deadline.
template <class Ask>
Times measure(int samples, double rate_hz, Ask ask) {
  Times times;
  constexpr int kWarmUp = 200;
  auto next = Clock::now();
  for (int i = 0; i < samples + kWarmUp; ++i) {
    next += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / rate_hz));
    std::this_thread::sleep_until(next);
    Stamp s;
    s.number = i;
    s.sent_ns = now_ns();
    const bool answered = ask(s);
    const std::int64_t end = now_ns();
    if (i < kWarmUp) continue;
    if (!answered) {
      ++times.lost;
      continue;
    }
    times.there_us.push_back(static_cast<double>(s.answered_ns - s.sent_ns) * 1e-3);
    times.round_us.push_back(static_cast<double>(end - s.sent_ns) * 1e-3);
  }
  return times;
}

/// A bus end that asks and waits for the answer.
class Asker {
 public:
  explicit Asker(Vendor vendor)
      : node_(open(vendor)),
        writer_(node_->writer(topics::kState)),
        reader_(node_->reader(topics::kCommand)) {}

  bool wait_for_match(Clock::duration limit) {
    const auto deadline = Clock::now() + limit;
    while (writer_->matched() < 1 || reader_->matched() < 1) {
      if (Clock::now() > deadline) return false;
      node_->wait(Clock::now() + 1ms);
    }
    return true;
  }
  bool ask(Stamp& s, Clock::duration limit) {
    put(s, payload_);
    writer_->write(payload_);
    const auto deadline = Clock::now() + limit;
    while (Clock::now() < deadline) {
      while (reader_->take(payload_))
        if (get(payload_).number == s.number) {
          s = get(payload_);
          return true;
        }
      node_->wait(deadline);
    }
    return false;
  }

 private:
  std::unique_ptr<bus::Node> node_;
  std::unique_ptr<bus::Writer> writer_;
  std::unique_ptr<bus::Reader> reader_;
  Payload payload_;
};

void latency(Vendor a, Vendor b, int samples, double rate_hz) {
  const pid_t child = start_answering(b);
  const pid_t parent = in_child([&] {
    Asker asker(a);
    if (!asker.wait_for_match(10s)) return;
    auto times = measure(samples, rate_hz, [&](Stamp& s) { return asker.ask(s, 200ms); });
    print((std::string(to_string(a)) + " - " + to_string(b)).c_str(), times);
  });
  waitpid(parent, nullptr, 0);
  kill_and_reap(child);
}

/// The answering process is killed and started again, five times: from the start to its first answer.
void restart(Vendor a, Vendor b) {
  const pid_t asking = in_child([&] {
    Asker asker(a);
    std::vector<double> ms;
    std::int64_t number = 0;
    for (int i = 0; i < 6; ++i) {
      const auto began = Clock::now();
      const pid_t child = start_answering(b);
      Stamp s;
      do {
        s = Stamp();
        s.number = ++number;
        s.sent_ns = now_ns();
      } while (!asker.ask(s, 2ms) && Clock::now() - began < 10s);
      if (i > 0) ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
      kill_and_reap(child);
    }
    std::printf("%-24s restart after kill -9, ms: median %.0f, longest %.0f\n",
                (std::string(to_string(a)) + " - " + to_string(b)).c_str(), percentile(ms, 0.5),
                percentile(ms, 1));
    std::fflush(stdout);
  });
  waitpid(asking, nullptr, 0);
}

int udp_socket(sockaddr_in& address) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), length) != 0) std::exit(2);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  const timeval limit{0, 200000};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  return fd;
}

void udp_floor(int samples, double rate_hz) {
  sockaddr_in here, there;
  const int a = udp_socket(here), b = udp_socket(there);
  Payload p;
  const pid_t child = in_child([&] {
    p.resize(kBytes);
    while (true) {
      if (recv(b, p.data(), p.size(), 0) <= 0) continue;
      Stamp s = get(p);
      s.answered_ns = now_ns();
      put(s, p);
      sendto(b, p.data(), p.size(), 0, reinterpret_cast<const sockaddr*>(&here), sizeof here);
    }
  });
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
  print("udp", times);
  kill_and_reap(child);
  close(a);
  close(b);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[1]) == "answer") {
    const auto vendor = bus::vendor_from(argv[2]);
    if (vendor) answer(vendor.value());
    return 2;
  }
  const int samples = argc > 1 ? std::atoi(argv[1]) : 5000;
  const double rate_hz = argc > 2 ? std::atof(argv[2]) : 1000;
  if (samples < 1 || !(rate_hz > 0)) {
    std::fprintf(stderr, "usage: hamel_bus_bench [samples [rate_hz]]\n");
    return 2;
  }
  std::printf("%d samples at %g Hz, microseconds: p50 p99 p99.9 [max]\n", samples, rate_hz);
  std::fflush(stdout);
  udp_floor(samples, rate_hz);
  for (const auto& [a, b] : {std::pair{Vendor::fastdds, Vendor::fastdds},
                             {Vendor::cyclonedds, Vendor::cyclonedds},
                             {Vendor::fastdds, Vendor::cyclonedds},
                             {Vendor::cyclonedds, Vendor::fastdds}}) {
    latency(a, b, samples, rate_hz);
    restart(a, b);
  }
}
