/// What every vendor's bus must do alike with samples: order, what is kept, what is refused, what is lost.

#include <atomic>
#include <map>
#include <thread>

#include "common/wire/endpoint.h"
#include "tests/integration/bus_pairs.h"
#include "tests/integration/random_messages.h"

namespace hamel::test {
namespace {

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

INSTANTIATE_TEST_SUITE_P(Vendors, Bus, kPairs, name_of);

}  // namespace
}  // namespace hamel::test
