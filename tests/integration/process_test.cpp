/// What happens to others when a process stops, dies or comes back.  The peer is this program again, as a
/// process of its own: it answers every sample of the state topic with one on the command topic.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <set>

#include "clients/hamel/bench_ping.h"

namespace hamel {
namespace {

using bus::Payload;
using bus::Vendor;
using client::ping::Child;
using client::ping::Clock;
using client::ping::open;
using namespace std::chrono_literals;

constexpr auto kDeadline = 20s;

constexpr std::uint32_t kArm = 7, kStrangers = 1000, kManyKeys = 200;  // keys of a stranger: from 1000 on

Payload sample(std::uint32_t number, std::size_t size, std::uint32_t key = kArm) {
  Payload p(size);
  p[1] = std::byte{1};
  std::memcpy(p.data() + 4, &key, 4);
  std::memcpy(p.data() + 8, &number, 4);
  return p;
}
std::uint32_t key_in(const Payload& p) {
  std::uint32_t key;
  std::memcpy(&key, p.data() + 4, 4);
  return key;
}

/// The peer's whole life.
[[noreturn]] void answer(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const auto state = node->reader(topics::kState), large = node->reader(topics::kObstacles);
  const auto command = node->writer(topics::kCommand);
  Payload p;
  while (true) {
    node->wait(Clock::now() + 1s);
    while (state->take(p))
      if (key_in(p) < kStrangers) command->write(p);
    while (large->take(p)) {
    }
  }
}

/// The life of a stranger: 200 keys of its own on three topics, one each a millisecond.
[[noreturn]] void crowd(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const std::unique_ptr<bus::Writer> writers[] = {
      node->writer(topics::kState), node->writer(topics::kCommand), node->writer(topics::kObstacles)};
  auto next = Clock::now();
  for (std::uint32_t i = 0;; ++i) {
    for (const auto& w : writers) w->write(sample(i, 400, kStrangers + i % kManyKeys));
    for (next += 1ms; Clock::now() < next;) node->wait(next);
  }
}

/// Another stranger's: more keys than Fast DDS is let keep, each said once; then it stays.
constexpr std::uint32_t kHorde = 90'000;
[[noreturn]] void swarm(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const auto command = node->writer(topics::kCommand);
  while (command->matched() == 0) node->wait(Clock::now() + 5ms);
  for (std::uint32_t i = 0;; ++i) {
    if (i < kHorde) command->write(sample(i, 32, kStrangers + i));
    if (i % 100 == 0) node->wait(Clock::now() + 1ms);  // as fast as most can read
  }
}

/// A client that looks at one sample and leaves.
[[noreturn]] void glance(Vendor vendor, std::uint32_t domain) {
  {
    const auto node = open(vendor, domain);
    const auto state = node->reader(topics::kState, 0, bus::Ask::glimpse);
    Payload p;
    while (!state->take(p)) node->wait(Clock::now() + 100ms);
  }
  _exit(0);
}

auto program(const char* role, Vendor vendor, std::uint32_t domain) {
  return [=] { execl("/proc/self/exe", role, to_string(vendor), std::to_string(domain).c_str(), nullptr); };
}

struct Pair {
  Vendor here, there;
  std::uint32_t domain;
};

class Process : public testing::TestWithParam<Pair> {
 protected:
  /// Asks until the peer answers the very question.
  bool answered(bus::Node& node, bus::Writer& writer, bus::Reader& reader, std::uint32_t key = kArm) {
    const auto deadline = Clock::now() + kDeadline;
    Payload p;
    while (Clock::now() < deadline) {
      const Payload asked = sample(++number_, 400, key);
      writer.write(asked);
      const auto soon = Clock::now() + 5ms;
      while (Clock::now() < soon) {
        while (reader.take(p)) {
          keys_.insert(key_in(p));
          if (p == asked) return true;
        }
        node.wait(soon);
      }
    }
    return false;
  }
  std::uint32_t number_ = 0;
  std::set<std::uint32_t> keys_;  ///< all that came
};

TEST_P(Process, StoppedOneBlocksNobodyAndIsBackWhenItContinues) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain);
  const auto writer = node->writer(topics::kState), large = node->writer(topics::kObstacles);
  const auto reader = node->reader(topics::kCommand);
  const Child other(program("peer", there, domain));
  ASSERT_TRUE(answered(*node, *writer, *reader));
  kill(other.pid(), SIGSTOP);
  auto longest = Clock::duration::zero();
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const auto began = Clock::now();
    writer->write(sample(1'000'000 + i, 2000));
    if (i % 100 == 0) large->write(sample(i, 600000));
    longest = std::max(longest, Clock::now() - began);
  }
  EXPECT_LT(longest, 1s) << "a write waited for a reader that stands still";
  kill(other.pid(), SIGCONT);
  EXPECT_TRUE(answered(*node, *writer, *reader));
}

TEST_P(Process, KilledOneIsMissedAndItsSuccessorFound) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain + 1);
  const auto writer = node->writer(topics::kState);
  const auto reader = node->reader(topics::kCommand);
  for (int life = 0; life < 3; ++life) {
    const Child other(program("peer", there, domain + 1));
    ASSERT_TRUE(answered(*node, *writer, *reader)) << "life " << life;
  }
  const auto deadline = Clock::now() + kDeadline;
  while ((writer->matched() > 0 || reader->matched() > 0) && Clock::now() < deadline)
    node->wait(Clock::now() + 20ms);
  EXPECT_EQ(writer->matched(), 0);
  EXPECT_EQ(reader->matched(), 0);
}

/// The keys that a reader keeps are bounded, and a key too many costs those that are known nothing.
TEST_P(Process, AStrangerWithManyKeysSilencesNobody) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain + 10);
  const auto writer = node->writer(topics::kState);
  const auto reader = node->reader(topics::kCommand);
  const Child other(program("peer", there, domain + 10));
  ASSERT_TRUE(answered(*node, *writer, *reader));
  Child stranger(program("crowd", there, domain + 10));
  const auto deadline = Clock::now() + kDeadline;
  int questions = 0;
  for (; questions < 500 || reader->counters().lost < kManyKeys / 4; ++questions) {
    ASSERT_LT(Clock::now(), deadline) << questions << " answers, lost " << reader->counters().lost;
    ASSERT_TRUE(answered(*node, *writer, *reader)) << "question " << questions;
  }
  EXPECT_GT(keys_.size(), 10U) << "the stranger was heard";
  EXPECT_LE(keys_.size(), 64U);
  stranger.end();
  EXPECT_TRUE(answered(*node, *writer, *reader, 300)) << "an arm that comes when the stranger has gone";
}

/// Flat out, as lockstep is: what a client that comes and goes leaves to be repeated, and to be forgotten.
TEST_P(Process, ClientsThatComeAndGoStopNobody) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain + 12);
  const auto writer = node->writer(topics::kState);
  const auto reader = node->reader(topics::kCommand);
  const Child other(program("peer", there, domain + 12));
  for (int i = 0; i < 40; ++i) {
    const Child client(program("glance", there, domain + 12));
    const auto deadline = Clock::now() + kDeadline;
    do {
      ASSERT_LT(Clock::now(), deadline) << "client " << i << " sees nothing";
      ASSERT_TRUE(answered(*node, *writer, *reader)) << "client " << i;
    } while (waitpid(client.pid(), nullptr, WNOHANG) == 0);
  }
  EXPECT_TRUE(answered(*node, *writer, *reader));
}

/// However many keys a stranger has, nobody ends or fills up, and those that are known are heard again.
TEST_P(Process, AStrangerWithAHordeOfKeysEndsNobody) {
  const auto [here, there, domain] = GetParam();
  const auto node = open(here, domain + 11);
  const auto writer = node->writer(topics::kState);
  const auto reader = node->reader(topics::kCommand);
  const Child other(program("peer", there, domain + 11));
  ASSERT_TRUE(answered(*node, *writer, *reader));
  const Child stranger(program("swarm", there, domain + 11));
  const auto deadline = Clock::now() + 60s;
  while (reader->counters().lost < kHorde * 9 / 10) {
    ASSERT_LT(Clock::now(), deadline) << "lost " << reader->counters().lost;
    ASSERT_TRUE(answered(*node, *writer, *reader));
  }
  EXPECT_TRUE(answered(*node, *writer, *reader));
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
  const std::string_view role = argv[0];
  if (argc == 3 && (role == "peer" || role == "crowd" || role == "swarm" || role == "glance")) {
    const auto live = role == "peer"    ? hamel::answer
                      : role == "crowd" ? hamel::crowd
                      : role == "swarm" ? hamel::swarm
                                        : hamel::glance;
    live(hamel::bus::vendor_from(argv[1]).value(), static_cast<std::uint32_t>(std::atoi(argv[2])));
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
