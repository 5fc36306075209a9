/// Our bus beside the vendors' bare API: the round trip of a state and its command between two processes,
/// typed on both sides, reliable, the owner asleep until a listener wakes it.
///
///   hamel_bare_bench [rounds [samples [rate_hz]]]        a JSON line for each vendor
///
/// Rounds of both follow each other in turn, so that a machine that is not idle disturbs both alike; the
/// ratio is that of the medians over the rounds.  Exit code 1 where ours takes more than 1.2 times theirs.

#include <cstdio>
#include <cstdlib>
#include <string>

#include "clients/hamel/bench_ping.h"
#include "common/wire/endpoint.h"
#include "tests/bench/bare.h"

namespace {

using namespace hamel;
using namespace hamel::client::ping;
using bench::BareEnd;
using client::quantile;

constexpr std::uint32_t kDomain = 97;
constexpr double kMost = 1.2;

/// The bus, as a service uses it.
template <class Out, class In>
class OurEnd {
 public:
  OurEnd(Vendor vendor, std::uint32_t domain) : node_(open(vendor, domain)), out_(*node_), in_(*node_) {
    fill(m_);
  }
  bool matched() { return out_.matched() > 0 && in_.matched() > 0; }
  void wait(Clock::time_point deadline) { node_->wait(deadline); }
  void write(std::uint64_t number) {
    m_.step = number;
    out_.publish(m_);
  }
  std::uint64_t take() { return in_.take(got_) ? got_.step : 0; }

 private:
  static void fill(wire::ArmState& m) {
    m.arm = 1;
    m.position = m.velocity = m.momentum = m.torque_applied =
        wire::JointVector::Constant(bench::kJoints, 0.5);
    m.caused_by.size = 1;
  }
  static void fill(wire::TorqueCommand& m) {
    m.arm = 1;
    m.torque = wire::JointVector::Constant(bench::kJoints, 0.5);
    m.caused_by.size = 3;
  }
  std::unique_ptr<bus::Node> node_;
  wire::Publisher<Out> out_;
  wire::Subscription<In> in_;
  Out m_;
  In got_;
};

class TheirEnd {
 public:
  TheirEnd(Vendor vendor, bool asks)
      : end_(vendor == Vendor::fastdds ? bench::bare_fast(asks, kDomain)
                                       : bench::bare_cyclone(asks, kDomain)) {}
  bool matched() { return end_->matched(); }
  void wait(Clock::time_point deadline) { end_->bell.wait(deadline); }
  void write(std::uint64_t number) { end_->write(number); }
  std::uint64_t take() { return end_->take(); }

 private:
  std::unique_ptr<BareEnd> end_;
};

template <class End>
[[noreturn]] void answer_all(End end) {
  while (true) {
    end.wait(Clock::now() + 100ms);
    while (const auto number = end.take()) end.write(number);
  }
}

/// The other process.
[[noreturn]] void be_the_other(const std::string& side, Vendor vendor) {
  if (side == "ours") answer_all(OurEnd<wire::TorqueCommand, wire::ArmState>(vendor, kDomain));
  answer_all(TheirEnd(vendor, false));
}

template <class End>
double round_p50_us(End end, const char* side, Vendor vendor, int samples, double rate_hz) {
  const Child other(
      [=] { execl("/proc/self/exe", "hamel_bare_bench", "--answer", side, to_string(vendor), nullptr); });
  const auto limit = Clock::now() + 20s;
  while (!end.matched()) {
    if (Clock::now() > limit) throw std::runtime_error(std::string(side) + ": the two processes do not meet");
    end.wait(Clock::now() + 5ms);
  }
  auto times = measure(samples, rate_hz, [&](Stamp& s) {
    const auto number = static_cast<std::uint64_t>(s.number) + 1;
    end.write(number);
    for (const auto deadline = Clock::now() + 200ms; Clock::now() < deadline; end.wait(deadline))
      while (const auto got = end.take())
        if (got == number) return true;
    return false;
  });
  if (times.lost > samples / 100) throw std::runtime_error(std::string(side) + ": answers were lost");
  return quantile(times.round_us, 0.5);
}

bool compare(Vendor vendor, int rounds, int samples, double rate_hz) {
  std::vector<double> ours, theirs;
  for (int i = 0; i < rounds; ++i) {
    ours.push_back(round_p50_us(OurEnd<wire::ArmState, wire::TorqueCommand>(vendor, kDomain), "ours", vendor,
                                samples, rate_hz));
    theirs.push_back(round_p50_us(TheirEnd(vendor, true), "theirs", vendor, samples, rate_hz));
  }
  const double a = quantile(ours, 0.5), b = quantile(theirs, 0.5);
  std::printf(
      "{\"bus\": \"%s\", \"rounds\": %d, \"ours_p50_us\": %.1f, \"bare_p50_us\": %.1f, \"ratio\": %.2f}\n",
      to_string(vendor), rounds, a, b, a / b);
  std::fflush(stdout);
  return a <= kMost * b;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc == 4 && std::string(argv[1]) == "--answer")
    be_the_other(argv[2], bus::vendor_from(argv[3]).value());
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 5, samples = argc > 2 ? std::atoi(argv[2]) : 1500;
  const double rate_hz = argc > 3 ? std::atof(argv[3]) : 1000;
  bool good = true;
  for (const Vendor v : {Vendor::fastdds, Vendor::cyclonedds}) good &= compare(v, rounds, samples, rate_hz);
  return good ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "hamel_bare_bench: %s\n", e.what());
  return 3;
}
