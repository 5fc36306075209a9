/// What every vendor's bus must do alike.  Each test has a domain of its own; waits end with the event or a
/// deadline.

#include "common/bus/bus.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "common/wire/endpoint.h"
#include "tests/integration/random_messages.h"

namespace hamel {
namespace {

using bus::Payload;
using bus::Vendor;
using namespace std::chrono_literals;

constexpr auto kDeadline = 20s;  // generous: a test that waits this long has failed

/// A payload of `topic`: header, key, a number, then filling.
Payload sample(std::uint32_t key, std::uint32_t number, std::size_t size = 32) {
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
std::uint32_t number_in(const Payload& p) {
  std::uint32_t number;
  std::memcpy(&number, p.data() + 8, 4);
  return number;
}

using Log = std::function<void(const std::string&)>;

std::unique_ptr<bus::Node> open(Vendor vendor, std::uint32_t domain, Log log = {},
                                const std::string& name = "hamel") {
  bus::NodeOptions options;
  options.name = name;
  options.vendor = vendor;
  options.domain = domain;
  options.log = std::move(log);
  auto node = bus::open(options);
  if (!node) throw std::runtime_error(to_string(node.error()));
  return std::move(node).value();
}

/// Waits on `node` until `done`; false when the deadline passes first.
template <class Done>
bool wait_for(bus::Node& node, Done done) {
  const auto deadline = std::chrono::steady_clock::now() + kDeadline;
  while (!done()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    node.wait(std::min(deadline, std::chrono::steady_clock::now() + 5ms));  // matching does not wake
  }
  return true;
}

/// The two ends: who writes and who reads.
struct Pair {
  Vendor from, to;
  std::uint32_t domain;
};

class Bus : public testing::TestWithParam<Pair> {
 protected:
  std::unique_ptr<bus::Node> from(std::uint32_t n, Log log = {}) {
    return open(GetParam().from, GetParam().domain + n, std::move(log));
  }
  std::unique_ptr<bus::Node> to(std::uint32_t n, Log log = {}) {
    return open(GetParam().to, GetParam().domain + n, std::move(log));
  }
};

TEST_P(Bus, StreamKeepsOrderAndLosesNothing) {
  const auto a = from(0), b = to(0);
  const auto writer = a->writer(topics::kState);
  const auto reader = b->reader(topics::kState);
  ASSERT_TRUE(wait_for(*b, [&] { return writer->matched() == 1 && reader->matched() == 1; }));
  std::uint32_t next = 0;
  Payload p;
  for (std::uint32_t sent = 0; sent < 1000; ++sent) {  // never more than 100 on the way
    ASSERT_TRUE(writer->write(sample(7, sent, 400)));
    const auto take_all = [&] {
      while (reader->take(p)) {
        ASSERT_EQ(number_in(p), next);
        ++next;
      }
    };
    ASSERT_TRUE(wait_for(*b, [&] {
      take_all();
      return sent < next + 100;
    }));
    ASSERT_TRUE(sent != 999 || wait_for(*b, [&] {
                  take_all();
                  return next == 1000;
                }));
  }
  EXPECT_EQ(p, sample(7, 999, 400));
  EXPECT_EQ(writer->counters().samples, 1000U);
  EXPECT_EQ(reader->counters().samples, 1000U);
  EXPECT_EQ(reader->counters().lost, 0U);
}

TEST_P(Bus, LateReaderGetsTheLastLatchedSampleOfEachKey) {
  const auto a = from(1), b = to(1);
  const auto writer = a->writer(topics::kGoal);
  for (std::uint32_t number = 0; number < 5; ++number)
    for (std::uint32_t key : {1U, 2U, 300U, 0x12345678U}) ASSERT_TRUE(writer->write(sample(key, number)));
  const auto reader = b->reader(topics::kGoal);
  std::map<std::uint32_t, std::uint32_t> last;
  int taken = 0;
  Payload p;
  EXPECT_TRUE(wait_for(*b, [&] {
    for (; reader->take(p); ++taken) last[key_in(p)] = number_in(p);
    return last.size() == 4;
  }));
  EXPECT_EQ(taken, 4);
  for (const auto& [key, number] : last) EXPECT_EQ(number, 4U) << "key " << key;
}

TEST_P(Bus, LateReaderOfAStreamGetsOnlyWhatComesNow) {
  const auto a = from(2), b = to(2);
  const auto writer = a->writer(topics::kState);
  for (std::uint32_t i = 0; i < 10; ++i) ASSERT_TRUE(writer->write(sample(1, i)));
  const auto reader = b->reader(topics::kState);
  ASSERT_TRUE(wait_for(*b, [&] { return writer->matched() == 1 && reader->matched() == 1; }));
  ASSERT_TRUE(writer->write(sample(1, 99)));
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_EQ(number_in(p), 99U);
}

TEST_P(Bus, SlowReaderFindsTheLastLatchedSample) {
  const auto a = from(3), b = to(3);
  const auto writer = a->writer(topics::kMode);
  const auto reader = b->reader(topics::kMode);
  ASSERT_TRUE(wait_for(*b, [&] { return writer->matched() == 1 && reader->matched() == 1; }));
  for (std::uint32_t i = 0; i < 50; ++i) ASSERT_TRUE(writer->write(sample(1, i)));
  std::uint32_t last = 0;
  Payload p;
  EXPECT_TRUE(wait_for(*b, [&] {
    while (reader->take(p)) last = number_in(p);
    return last == 49;
  }));
}

TEST_P(Bus, AReaderMayAskForMoreOfALatchedTopicThanTheLast) {
  const auto a = from(13), b = to(13);
  const auto writer = a->writer(topics::kObstacles);
  const auto reader = b->reader(topics::kObstacles, 64);
  const auto witness =
      b->reader(topics::kObstacles);  // of the usual depth: when it has the last, all are there
  ASSERT_TRUE(wait_for(*b, [&] { return writer->matched() == 2 && reader->matched() == 1; }));
  for (std::uint32_t i = 0; i < 50; ++i) ASSERT_TRUE(writer->write(sample(7, i)));
  Payload p = sample(7, 0);
  ASSERT_TRUE(wait_for(*b, [&] {
    while (number_in(p) != 49 && witness->take(p)) {
    }
    return number_in(p) == 49;
  }));
  for (std::uint32_t i = 0; i < 50; ++i) {
    ASSERT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
    ASSERT_EQ(number_in(p), i);
  }
}

TEST_P(Bus, StoppedReaderDoesNotBlockTheWriter) {
  const auto a = from(4), b = to(4);
  const auto writer = a->writer(topics::kState);
  const auto large = a->writer(topics::kObstacles);
  const auto reader = b->reader(topics::kState);
  const auto large_reader = b->reader(topics::kObstacles);
  ASSERT_TRUE(wait_for(*b, [&] {
    return writer->matched() + large->matched() == 2 && reader->matched() + large_reader->matched() == 2;
  }));
  const auto began = std::chrono::steady_clock::now();
  for (std::uint32_t i = 0; i < 5000; ++i) ASSERT_TRUE(writer->write(sample(1, i, 2000)));  // nobody takes
  for (std::uint32_t i = 0; i < 20; ++i) ASSERT_TRUE(large->write(sample(i, i, 600000)));
  EXPECT_LT(std::chrono::steady_clock::now() - began, 10s);
  std::uint32_t last = 0, next = 5000;
  int taken = 0;
  Payload p;
  // A stream may lose any sample, the last of the flood too: then the next one comes.
  EXPECT_TRUE(wait_for(*b,
                       [&] {
                         for (; reader->take(p); ++taken) {
                           EXPECT_TRUE(taken == 0 || number_in(p) > last);
                           last = number_in(p);
                         }
                         return last >= 4999 || !writer->write(sample(1, next++, 2000));
                       }))
      << "last seen " << last;
  EXPECT_GE(last, 4999u);
  EXPECT_GE(taken, 1);
}

TEST_P(Bus, LargeSampleArrivesWhole) {
  const auto a = from(5), b = to(5);
  const auto writer = a->writer(topics::kObstacles);
  const auto reader = b->reader(topics::kObstacles);
  Payload big = sample(3, 4, topics::kObstacles.max_bytes), p;
  for (std::size_t i = 12; i < big.size(); ++i) big[i] = static_cast<std::byte>(i * 7 + i / 251);
  ASSERT_TRUE(writer->write(big));
  ASSERT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_TRUE(p == big);
}

TEST_P(Bus, RefusesToWriteWhatNoReaderMayTake) {
  const auto a = from(6);
  const auto writer = a->writer(topics::kMode);
  EXPECT_FALSE(writer->write(sample(1, 1, topics::kMode.max_bytes + 4)));
  EXPECT_FALSE(writer->write(Payload(7)));
  Payload odd = sample(1, 1);
  odd[1] = std::byte{7};
  EXPECT_FALSE(writer->write(odd));
  EXPECT_EQ(writer->counters().refused, 3U);
  EXPECT_EQ(writer->counters().samples, 0U);
}

TEST_P(Bus, TopicsAndDomainsDoNotMix) {
  const auto a = from(7), b = to(7), elsewhere = to(8);
  const auto state = a->writer(topics::kState), clock = a->writer(topics::kClock);
  const auto reader = b->reader(topics::kClock), stranger = elsewhere->reader(topics::kClock);
  ASSERT_TRUE(wait_for(*b, [&] { return clock->matched() == 1 && reader->matched() == 1; }));
  ASSERT_TRUE(state->write(sample(1, 1)));
  ASSERT_TRUE(clock->write(sample(1, 2)));
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_EQ(number_in(p), 2U);
  EXPECT_FALSE(reader->take(p));
  EXPECT_EQ(stranger->matched(), 0);
  EXPECT_FALSE(stranger->take(p));
}

TEST_P(Bus, EveryMessageArrivesAsItWasSent) {
  const auto a = from(9), b = to(9);
  test::Random random(31);
  const auto there_and_equal = [&]<class T>(T sent) {
    test::randomise(random, sent);
    wire::Publisher<T> publisher(*a);
    const auto raw = b->reader(wire::topic_of<T>());
    ASSERT_TRUE(wait_for(*b, [&] { return publisher.matched() == 1 && raw->matched() == 1; }));
    ASSERT_TRUE(publisher.publish(sent));
    Payload p, expected;
    ASSERT_TRUE(wait_for(*b, [&] { return raw->take(p); })) << wire::topic_of<T>().name;
    ASSERT_TRUE(wire::encode(sent, expected));
    EXPECT_TRUE(p == expected) << wire::topic_of<T>().name;
  };
  there_and_equal(wire::ArmState());
  there_and_equal(wire::TorqueCommand());
  there_and_equal(wire::Goal());
  there_and_equal(wire::ObstacleSet());
  there_and_equal(wire::PlannerReport());
  there_and_equal(wire::ModeCommand());
  there_and_equal(wire::ServiceStatus());
  there_and_equal(wire::RobotDescription());
  there_and_equal(wire::SimulationClock());
  there_and_equal(wire::RunSummary());
}

/// Good or broken, what comes in a flood is taken in rounds; nobody sleeps while a round is due.
TEST_P(Bus, AFloodIsTakenInRounds) {
  constexpr int kRound = wire::Subscription<wire::TorqueCommand>::kRound, kAll = 3 * kRound + 8;
  const auto a = from(17), b = to(17);
  const auto writer = a->writer(topics::kCommand);
  wire::Subscription<wire::TorqueCommand> commands(*b);
  const auto witness = b->reader(topics::kCommand);
  ASSERT_TRUE(wait_for(
      *b, [&] { return writer->matched() == 2 && commands.matched() == 1 && witness->matched() == 1; }));
  Payload good, p;
  ASSERT_TRUE(wire::encode(wire::TorqueCommand(), good));
  for (int i = 0; i < kAll; ++i) ASSERT_TRUE(writer->write(i % 4 == 3 ? good : sample(0, 1)));
  int came = 0;
  ASSERT_TRUE(wait_for(*b, [&] {
    while (witness->take(p)) ++came;
    return came == kAll;
  }));
  const auto at_once = [&] { return b->wait(std::chrono::steady_clock::now()); };
  at_once();
  wire::TorqueCommand m;
  int taken = 0;
  for (int round = 1; round <= 3; ++round) {
    while (commands.take(m)) ++taken;
    EXPECT_EQ(taken, round * kRound / 4);
    EXPECT_TRUE(at_once()) << "round " << round;
  }
  EXPECT_TRUE(wait_for(*b, [&] {
    while (commands.take(m)) ++taken;
    return taken == kAll / 4;
  }));
  EXPECT_EQ(commands.undecodable(), 3U * kAll / 4);
}

TEST_P(Bus, WhatMustBeRefusedIsPassedOverInRounds) {
  if (GetParam().from == Vendor::inproc) return;  // its writers and readers are of one topic
  Topic larger = topics::kMode;
  larger.delivery = Delivery::stream;
  const Topic stream = larger;
  larger.max_bytes *= 2;
  const auto a = from(18), b = to(18);
  const auto writer = a->writer(larger);
  const auto reader = b->reader(stream), witness = b->reader(larger);
  ASSERT_TRUE(wait_for(
      *b, [&] { return writer->matched() == 2 && reader->matched() == 1 && witness->matched() == 1; }));
  for (std::uint32_t i = 0; i < 100; ++i) ASSERT_TRUE(writer->write(sample(1, i, larger.max_bytes)));
  ASSERT_TRUE(writer->write(sample(1, 100)));
  Payload p = sample(1, 0);
  ASSERT_TRUE(wait_for(*b, [&] {
    while (number_in(p) != 100 && witness->take(p)) {
    }
    return number_in(p) == 100;
  }));
  EXPECT_FALSE(reader->take(p));
  EXPECT_TRUE(b->wait(std::chrono::steady_clock::now())) << "there is more";
  EXPECT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_EQ(p, sample(1, 100));
  EXPECT_EQ(reader->counters().refused, 100U);
}

/// What a reader knows of its writers: who wrote, who took back, who lives.
TEST_P(Bus, TellsWhoWrote) {
  const auto a = from(13), b = to(13);
  const auto first = a->writer(topics::kGoal), second = a->writer(topics::kGoal);
  const auto reader = b->reader(topics::kGoal);
  EXPECT_NE(first->id(), second->id());
  ASSERT_TRUE(first->write(sample(1, 1)));
  ASSERT_TRUE(second->write(sample(2, 2)));
  std::map<std::uint32_t, bus::WriterId> by;
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] {
    while (reader->take(p)) by[key_in(p)] = reader->from();
    return by.size() == 2;
  }));
  EXPECT_EQ(by[1], first->id());
  EXPECT_EQ(by[2], second->id());
}

TEST_P(Bus, AKeyThatIsDisposedIsGoneForLateReaders) {
  const auto a = from(14), b = to(14);
  const auto writer = a->writer(topics::kGoal);
  const auto early = b->reader(topics::kGoal);
  for (const std::uint32_t key : {1U, 0x12345678U}) ASSERT_TRUE(writer->write(sample(key, key)));
  Payload p;
  int taken = 0;
  ASSERT_TRUE(wait_for(*b, [&] {
    while (early->take(p)) ++taken;
    return taken == 2;
  }));
  ASSERT_TRUE(writer->dispose(sample(0x12345678, 0)));
  ASSERT_TRUE(wait_for(*b, [&] { return !early->take(p) && early->counters().disposed == 1; }));
  const auto late = b->reader(topics::kGoal);
  ASSERT_TRUE(wait_for(*b, [&] { return late->take(p); }));
  EXPECT_EQ(key_in(p), 1U);
  // A word said after the dispose comes behind whatever the late reader was given of the past.
  ASSERT_TRUE(writer->write(sample(5, 5)));
  ASSERT_TRUE(wait_for(*b, [&] { return late->take(p); }));
  EXPECT_EQ(key_in(p), 5U);
}

TEST_P(Bus, BrokenPromisesAreCounted) {
  if (GetParam().from == Vendor::inproc) return;  // a writer within the process needs no watching
  const auto a = from(15), b = to(15);
  const auto reader = b->reader(topics::kCommand, 0, bus::Ask::promises),
             lenient = b->reader(topics::kCommand);
  auto node = open(GetParam().from, GetParam().domain + 15);
  const auto writer = node->writer(topics::kCommand);
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] {
    writer->write(sample(1, 1));
    return reader->take(p) && lenient->take(p);
  }));
  EXPECT_TRUE(wait_for(*b, [&] { return reader->counters().late > 0; })) << "deadline: nothing for 50 ms";
  EXPECT_EQ(lenient->counters().late, 0U) << "did not ask";
}

/// From the first listing on, no end stands there without its participant.
TEST_P(Bus, ListsTheEndsOfOthers) {
  const auto a = from(16), b = to(16);
  const auto writer = a->writer(topics::kGoal);
  const auto reader = a->reader(topics::kState);
  std::vector<bus::Endpoint> ends;
  ASSERT_TRUE(wait_for(*b, [&] {
    ends = b->endpoints();
    for (const bus::Endpoint& e : ends) EXPECT_TRUE(!e.writes || e.participant == "hamel") << e.topic;
    return ends.size() >= 2;
  }));
  ASSERT_EQ(ends.size(), 2U);
  for (const bus::Endpoint& e : ends) {
    EXPECT_EQ(e.topic, e.writes ? "hamel/v1/goal" : "hamel/v1/state");
    EXPECT_EQ(e.type, e.writes ? "hamel::v1::Goal" : "hamel::v1::ArmState");
    EXPECT_TRUE(e.reliable);
    EXPECT_EQ(e.latched, e.writes);
    EXPECT_TRUE(!e.writes || e.id == writer->id());
  }
}

/// Ends come and go while samples fly: nothing may be called on what is gone.
TEST_P(Bus, ReadersMayLeaveWhileSamplesArrive) {
  const auto a = from(10), b = to(10);
  const auto writer = a->writer(topics::kState);
  std::atomic<bool> stop{false};
  std::thread traffic([&] {
    for (std::uint32_t i = 0; !stop; ++i) {
      writer->write(sample(i % 3, i));
      if (i % 64 == 0) std::this_thread::yield();
    }
  });
  for (int i = 0; i < 20; ++i) {
    const auto reader = b->reader(topics::kState);
    Payload p;
    EXPECT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  }
  stop = true;
  traffic.join();
}

TEST_P(Bus, WakeEndsAWaitFromAnyThread) {
  const auto b = to(11);
  EXPECT_FALSE(b->wait(std::chrono::steady_clock::now() + 1ms));
  std::thread other([&] { b->wake(); });
  EXPECT_TRUE(b->wait(std::chrono::steady_clock::now() + kDeadline));
  other.join();
  b->wake();
  EXPECT_TRUE(b->wait(std::chrono::steady_clock::now() + kDeadline)) << "a wake before the wait counts";
}

/// A reader that asks for what its writer does not offer: counted on both sides and said once.
TEST_P(Bus, DisagreementAboutQosIsCountedAndSaidOnce) {
  if (GetParam().from == Vendor::inproc) return;  // one process cannot disagree with itself
  Topic stream = topics::kGoal;
  stream.delivery = Delivery::stream;
  std::mutex mutex;
  std::vector<std::string> said;
  const auto log = [&](const std::string& line) {
    std::lock_guard lock(mutex);
    said.push_back(line);
  };
  const auto a = from(12, log), b = to(12, log);
  const auto writer = a->writer(stream);
  const auto reader = b->reader(topics::kGoal);
  ASSERT_TRUE(wait_for(*b, [&] {
    a->wait(std::chrono::steady_clock::now());
    std::lock_guard lock(mutex);
    return writer->counters().incompatible > 0 && reader->counters().incompatible > 0 && said.size() == 2;
  }));
  EXPECT_EQ(writer->matched(), 0);
  std::lock_guard lock(mutex);
  ASSERT_EQ(said.size(), 2U);
  for (const std::string& line : said) {
    EXPECT_NE(line.find("hamel/v1/goal"), std::string::npos) << line;
    EXPECT_NE(line.find("durability"), std::string::npos) << line;
    EXPECT_NE(line.find("volatile"), std::string::npos) << line;
    EXPECT_NE(line.find("transient-local"), std::string::npos) << "both sides: " << line;
    EXPECT_NE(line.find("of hamel"), std::string::npos) << "whose: " << line;
  }
}

/// Each peer is named, with what the policy in question is on both sides.
TEST_P(Bus, EveryPeerThatBreaksAPolicyIsNamedWithItsValues) {
  if (GetParam().from == Vendor::inproc) return;
  Topic slow = topics::kState;
  slow.stale = 80ms;
  std::string said;
  int lines = 0;
  const auto b = to(19, [&](const std::string& line) {
    said = line;
    ++lines;
  });
  const auto reader = b->reader(topics::kState, 0, bus::Ask::promises);
  std::vector<std::unique_ptr<bus::Node>> nodes;
  std::vector<std::unique_ptr<bus::Writer>> writers;
  for (const std::string name : {"one", "two"}) {
    nodes.push_back(open(GetParam().from, GetParam().domain + 19, {}, name));
    writers.push_back(nodes.back()->writer(slow));
    ASSERT_TRUE(wait_for(*b, [&] { return said.find("of " + name + " offers") != std::string::npos; }))
        << said;
    for (const char* part : {"hamel/v1/state", "deadline", "51 ms", "80 ms"})
      EXPECT_NE(said.find(part), std::string::npos) << said;
    EXPECT_EQ(b->complaint(), said);
  }
  EXPECT_EQ(lines, 2);
  while (!writers.empty()) writers.pop_back();
}

/// A writer that leaves without a word: those that asked for it hear that it is silent.
TEST_P(Bus, AWriterThatNoLongerSaysThatItLivesIsSilent) {
  if (GetParam().from == Vendor::inproc) return;  // a writer within the process needs no watching
  const auto b = to(15);
  const auto reader = b->reader(topics::kGoal, 0, bus::Ask::promises), lenient = b->reader(topics::kGoal);
  int status = 0;
  const pid_t mute = fork();
  if (mute == 0) {
    execl("/proc/self/exe", "mute", to_string(GetParam().from),
          std::to_string(GetParam().domain + 15).c_str(), nullptr);
    _exit(1);
  }
  Payload p;
  EXPECT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_EQ(reader->counters().silent, 0U) << "it lives";
  kill(mute, SIGSTOP);
  EXPECT_TRUE(wait_for(*b, [&] { return reader->counters().silent > 0; })) << "nothing for a second";
  kill(mute, SIGKILL);
  waitpid(mute, &status, 0);
}

std::string name_of(const testing::TestParamInfo<Pair>& info) {
  return std::string(to_string(info.param.from)) + "_to_" + to_string(info.param.to);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Bus,
                         testing::Values(Pair{Vendor::inproc, Vendor::inproc, 100},
                                         Pair{Vendor::fastdds, Vendor::fastdds, 120},
                                         Pair{Vendor::cyclonedds, Vendor::cyclonedds, 140},
                                         Pair{Vendor::fastdds, Vendor::cyclonedds, 160},
                                         Pair{Vendor::cyclonedds, Vendor::fastdds, 180}),
                         name_of);

/// A writer of a process of its own, which says something once and then only that it lives.
[[noreturn]] void stay(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const auto writer = node->writer(topics::kGoal);
  writer->write(sample(1, 1));
  while (true) node->wait(std::chrono::steady_clock::now() + kDeadline);
}

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[0]) == "mute") {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    hamel::stay(hamel::bus::vendor_from(argv[1]).value(), static_cast<std::uint32_t>(std::atoi(argv[2])));
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
