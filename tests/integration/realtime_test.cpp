/// A thread beside the loop does not compete with it.

#include "common/runtime/realtime.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

using namespace hamel;

namespace {

struct Scheduling {
  int policy = -1, priority = -1, processors = 0;
  bool operator==(const Scheduling&) const = default;
};

Scheduling mine() {
  cpu_set_t set;
  sched_param p{};
  sched_getaffinity(0, sizeof set, &set);
  sched_getparam(0, &p);
  return {sched_getscheduler(0), p.sched_priority, CPU_COUNT(&set)};
}

TEST(Realtime, AThreadBesideTheLoopGoesBackToWhatWasBefore) {
  Scheduling before, loop, inherited, beside;
  bool allowed = false;
  std::thread([&] {
    before = mine();
    allowed = runtime::go_realtime({.priority = 5}).empty();
    (void)runtime::go_realtime({.cpu = sched_getcpu()});
    loop = mine();
    std::thread([&] {
      inherited = mine();
      runtime::go_ordinary();
      beside = mine();
    }).join();
  }).join();
  EXPECT_EQ(inherited, loop);
  EXPECT_EQ(loop.processors, 1);
  EXPECT_EQ(loop.policy, allowed ? SCHED_FIFO : before.policy);
  EXPECT_EQ(beside, before);
}

}  // namespace
