#pragma once
/// Questions and answers over a bus, timed: what `hamel bench bus` is made of.

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <vector>

#include "clients/hamel/timing.h"
#include "common/bus/bus.h"

namespace hamel::client::ping {

using namespace std::chrono_literals;
using bus::Payload;
using bus::Vendor;
using Clock = std::chrono::steady_clock;

inline constexpr std::size_t kBytes = 400;  // about a state of seven joints

inline std::int64_t now_ns() { return std::chrono::nanoseconds(Clock::now().time_since_epoch()).count(); }

/// Key 1, then a number and two times on the clock that all processes of a host share.
struct Stamp {
  std::uint8_t header[4] = {0, 1, 0, 0};
  std::uint32_t key = 1;
  std::int64_t number = 0, sent_ns = 0, answered_ns = 0;
};
inline void put(const Stamp& s, Payload& p) {
  p.resize(kBytes);
  std::memcpy(p.data(), &s, sizeof s);
}
inline Stamp get(const Payload& p) {
  Stamp s;
  std::memcpy(&s, p.data(), sizeof s);
  return s;
}

inline std::unique_ptr<bus::Node> open(Vendor vendor, std::uint32_t domain) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = domain;
  auto node = bus::open(options);
  if (!node) throw std::runtime_error(to_string(node.error()));
  return std::move(node).value();
}

/// Answers every state with a command, until `stop`.
inline void answer(Vendor vendor, std::uint32_t domain, const std::atomic<bool>& stop) {
  const auto node = open(vendor, domain);
  const auto reader = node->reader(topics::kState);
  const auto writer = node->writer(topics::kCommand);
  Payload p;
  while (!stop) {
    node->wait(Clock::now() + 100ms);
    while (reader->take(p)) {
      Stamp s = get(p);
      s.answered_ns = now_ns();
      put(s, p);
      writer->write(p);
    }
  }
}

/// A child process that ends with us; killed and reaped by its destructor.
class Child {
 public:
  template <class Work>
  explicit Child(Work work) : pid_(fork()) {
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    work();
    _exit(1);
  }
  ~Child() { end(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  pid_t pid() const { return pid_; }
  void end() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  pid_t pid_;
};

/// This program as the other process; executed anew, for nothing of a vendor's library survives a fork.
inline auto other_process(Vendor vendor, std::uint32_t domain) {
  return [=] {
    const std::string d = std::to_string(domain);
    execl("/proc/self/exe", "hamel", "bench", "bus", "--answer", to_string(vendor), "--domain", d.c_str(),
          nullptr);
  };
}

struct Times {
  std::vector<double> there_us, round_us;
  int lost = 0;
};

/// Asks `samples` times at `rate_hz` (0: at once after each answer); `ask(stamp)` gives the answer, or false.
template <class Ask>
Times measure(int samples, double rate_hz, Ask ask) {
  Times times;
  constexpr int kWarmUp = 200;
  auto next = Clock::now();
  for (int i = 0; i < samples + kWarmUp; ++i) {
    if (rate_hz > 0) {
      next += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / rate_hz));
      std::this_thread::sleep_until(next);
    }
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
  Asker(Vendor vendor, std::uint32_t domain)
      : node_(open(vendor, domain)),
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

}  // namespace hamel::client::ping
