/// The bit by which any thread wakes the owner of a node: no wake-up is lost, asleep or awake.

#include "common/bus/notifier.h"

#include <gtest/gtest.h>

#include <thread>

namespace hamel::bus {
namespace {

using namespace std::chrono_literals;
using Clock = Notifier::Clock;

TEST(Notifier, RemembersOneNotification) {
  Notifier n;
  EXPECT_FALSE(n.wait(Clock::now() - 1s));
  EXPECT_FALSE(n.wait(Clock::time_point::min())) << "a deadline before the clock began";
  n.notify();
  n.notify();
  EXPECT_TRUE(n.wait(Clock::now() - 1s));
  EXPECT_FALSE(n.wait(Clock::now() + 1ms));
  EXPECT_FALSE(n.wait(Clock::now() + 1ms, 10ms)) << "awake up to the deadline, not longer";
}

// Two threads hand a turn to each other: one lost wake-up and both wait for ever.
TEST(Notifier, LosesNoWakeUp) {
  for (const auto awake : {0us, 1us, 50us}) {
    constexpr int kTurns = 20000;
    Notifier here, there;
    int said = 0;
    std::thread other([&] {
      for (int i = 0; i < kTurns; ++i) {
        if (!there.wait(Clock::now() + 60s, awake)) return;
        ++said;
        here.notify();
      }
    });
    int heard = 0;
    for (; heard < kTurns; ++heard) {
      there.notify();
      if (!here.wait(Clock::now() + 60s, awake)) break;
      EXPECT_EQ(said, heard + 1) << "what was written before the notification is seen after it";
    }
    other.join();
    EXPECT_EQ(heard, kTurns);
  }
}

}  // namespace
}  // namespace hamel::bus
