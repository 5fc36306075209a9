/// What happens to others when a process stops, dies or comes back.  The peer is this program again, as a
/// process of its own: it answers every sample of the state topic with one on the command topic.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "common/bus/bus.h"

namespace hamel {
namespace {

using bus::Payload;
using bus::Vendor;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kDeadline = 20s;

Payload sample(std::uint32_t number, std::size_t size) {
  Payload p(size);
  p[1] = std::byte{1};
  p[4] = std::byte{7};
  std::memcpy(p.data() + 8, &number, 4);
  return p;
}

std::unique_ptr<bus::Node> open(Vendor vendor, std::uint32_t domain) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = domain;
  auto node = bus::open(options);
  if (!node) throw std::runtime_error(to_string(node.error()));
  return std::move(node).value();
}

/// The peer's whole life.
[[noreturn]] void answer(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const auto state = node->reader(topics::kState), large = node->reader(topics::kObstacles);
  const auto command = node->writer(topics::kCommand);
  Payload p;
  while (true) {
    node->wait(Clock::now() + 1s);
    while (state->take(p)) command->write(p);
    while (large->take(p)) {
    }
  }
}

struct Peer {
  Peer(Vendor vendor, std::uint32_t domain) : pid(fork()) {
    if (pid != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    execl("/proc/self/exe", "peer", to_string(vendor), std::to_string(domain).c_str(), nullptr);
    _exit(1);
  }
  ~Peer() { end(); }
  void end() {
    if (pid <= 0) return;
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
    pid = 0;
  }
  pid_t pid;
};

struct Pair {
  Vendor here, there;
  std::uint32_t domain;
};

class Process : public testing::TestWithParam<Pair> {
 protected:
  /// Asks until the peer answers the very question.
  bool answered(bus::Node& node, bus::Writer& writer, bus::Reader& reader) {
    const auto deadline = Clock::now() + kDeadline;
    Payload p;
    while (Clock::now() < deadline) {
      const std::uint32_t asked = ++number_;
      writer.write(sample(asked, 400));
      const auto soon = Clock::now() + 5ms;
      while (Clock::now() < soon) {
        while (reader.take(p))
          if (p == sample(asked, 400)) return true;
        node.wait(soon);
      }
    }
    return false;
  }
  std::uint32_t number_ = 0;
};

TEST_P(Process, StoppedOneBlocksNobodyAndIsBackWhenItContinues) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain);
  const auto writer = node->writer(topics::kState), large = node->writer(topics::kObstacles);
  const auto reader = node->reader(topics::kCommand);
  Peer peer(there, domain);
  ASSERT_TRUE(answered(*node, *writer, *reader));
  kill(peer.pid, SIGSTOP);
  auto longest = Clock::duration::zero();
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const auto began = Clock::now();
    writer->write(sample(1'000'000 + i, 2000));
    if (i % 100 == 0) large->write(sample(i, 600000));
    longest = std::max(longest, Clock::now() - began);
  }
  EXPECT_LT(longest, 1s) << "a write waited for a reader that stands still";
  kill(peer.pid, SIGCONT);
  EXPECT_TRUE(answered(*node, *writer, *reader));
}

TEST_P(Process, KilledOneIsMissedAndItsSuccessorFound) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain + 1);
  const auto writer = node->writer(topics::kState);
  const auto reader = node->reader(topics::kCommand);
  for (int life = 0; life < 3; ++life) {
    Peer peer(there, domain + 1);
    ASSERT_TRUE(answered(*node, *writer, *reader)) << "life " << life;
  }
  const auto deadline = Clock::now() + kDeadline;
  while ((writer->matched() > 0 || reader->matched() > 0) && Clock::now() < deadline)
    node->wait(Clock::now() + 20ms);
  EXPECT_EQ(writer->matched(), 0);
  EXPECT_EQ(reader->matched(), 0);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Process,
                         testing::Values(Pair{Vendor::fastdds, Vendor::fastdds, 200},
                                         Pair{Vendor::cyclonedds, Vendor::cyclonedds, 202},
                                         Pair{Vendor::fastdds, Vendor::cyclonedds, 204},
                                         Pair{Vendor::cyclonedds, Vendor::fastdds, 206}),
                         [](const auto& tested) {
                           return std::string(to_string(tested.param.here)) + "_and_" +
                                  to_string(tested.param.there);
                         });

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[0]) == "peer")
    hamel::answer(hamel::bus::vendor_from(argv[1]).value(), static_cast<std::uint32_t>(std::atoi(argv[2])));
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
