// What `hamel bench planner --assert` finds: a promise that is kept says nothing, one that is missed is
// named.
#include <gtest/gtest.h>

#include "clients/hamel/bench_promises.h"

namespace hamel::client {
namespace {

/// Trials of one cell: so many reached, so many touched, the rest stuck.
struct Made {
  const char* family;
  int spheres;
  int trials, reached, touched = 0;
  double variation = 0, cycle_s = 1e-6, slow_s = 0;  ///< slow_s: of one cycle in 50
};

Tally tally(const Made& m) {
  Tally t;
  for (int k = 0; k < m.trials; ++k) {
    Trial one;
    one.ending = k < m.reached               ? Ending::reached
                 : k < m.reached + m.touched ? Ending::collided
                                             : Ending::stuck;
    one.jerkiness = m.variation;
    for (int i = 0; i < 50; ++i) one.cycle.add(i == 0 && m.slow_s > 0 ? m.slow_s : m.cycle_s);
    t.add(static_cast<std::size_t>(k), one);
  }
  return t;
}

std::vector<std::string> missed(const std::vector<Made>& cells, const BenchConditions& made = {},
                                const char* method = "gyro") {
  std::vector<CellTally> all;
  for (const Made& m : cells) {
    const Cell cell{m.family, m.spheres, ""};
    all.push_back({cell, {"attract", method}, {tally({m.family, m.spheres, m.trials, 0}), tally(m)}});
  }
  return missed_promises(all, made);
}

// A Panda among 8 standing spheres: 96 % of its own, 98 % of all the family with rollouts.
TEST(Promises, KeptSayNothing) {
  EXPECT_TRUE(missed({{"panda_static", 8, 1000, 995, 0, 99}}).empty());
  EXPECT_TRUE(missed({{"panda_moving", 4, 1000, 990, 5}}).empty());
  EXPECT_TRUE(missed({{"panda_static", 16, 1000, 995, 0, 0, 18e-6, 80e-6}}).empty());
  EXPECT_TRUE(missed({}).empty());
}

TEST(Promises, OfReachAreJudgedByTheLowerEndOfTheInterval) {
  const auto few = missed({{"planar_static", 4, 20, 20}});  // all of 20: at least 84 %
  ASSERT_EQ(few.size(), 1u);
  EXPECT_EQ(few[0], "planar_static 4: reached 100.0 % of 20, at least 83.9 %, promised 96.0 %");
  EXPECT_TRUE(missed({{"planar_static", 4, 1000, 980}}).empty());
  EXPECT_EQ(missed({{"planar_static", 4, 1000, 950}}).size(), 1u);
}

TEST(Promises, OfASingleRunAreLower) {
  const std::vector<Made> cell{{"planar_static", 4, 1000, 950}};
  EXPECT_EQ(missed(cell, {.rollouts = true}).size(), 1u);
  EXPECT_TRUE(missed(cell, {.rollouts = false}).empty());
}

TEST(Promises, OneContactAmongStandingSpheresIsOneTooMany) {
  const auto lines = missed({{"planar_static", 1, 10000, 9990, 1}});
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines[0].find("1 contacts in 10000, promised 0.0 %"), std::string::npos) << lines[0];
}

// Moving ones: 0.5 % of all cells together, 1 % where a step is longer than 2 ms.
TEST(Promises, OfContactsWithMovingSpheresHoldForAllCellsTogether) {
  const auto cells = [](int touched) {
    return std::vector<Made>{{"panda_moving", 1, 1000, 990, 0}, {"panda_moving", 8, 1000, 970, touched}};
  };
  EXPECT_TRUE(missed(cells(10)).empty());
  EXPECT_EQ(missed(cells(11)),
            std::vector<std::string>{"panda_moving together: 11 contacts in 2000, promised 0.5 %"});
  EXPECT_TRUE(missed(cells(11), {.dt_s = 0.005}).empty());
  EXPECT_TRUE(missed(cells(20), {.dt_s = 0.005}).empty());
  EXPECT_EQ(missed(cells(21), {.dt_s = 0.005}).size(), 1u);
}

TEST(Promises, OfVariationAndCycleTimesAreNamed) {
  EXPECT_EQ(missed({{"panda_static", 8, 1000, 995, 0, 101}}),
            std::vector<std::string>{"panda_static 8: variation of accelerations 101.0, promised 100"});
  const auto slow = missed({{"panda_static", 16, 1000, 995, 0, 0, 25e-6, 200e-6}});
  ASSERT_EQ(slow.size(), 2u);
  EXPECT_NE(slow[0].find("cycle us, median"), std::string::npos) << slow[0];
  EXPECT_NE(slow[1].find("cycle us, 99 of 100"), std::string::npos) << slow[1];
  EXPECT_EQ(missed({{"panda_crowd", 256, 100, 50, 0, 0, 300e-6}}).size(), 1u) << "its reach is not promised";
}

TEST(Promises, AreOfGyroAlone) {
  EXPECT_TRUE(missed({{"planar_static", 4, 1000, 0, 1000}}, {}, "khatib").empty());
  EXPECT_TRUE(missed({{"planar_moving", 8, 1000, 0, 1000}}).empty()) << "nothing promised there";
}

}  // namespace
}  // namespace hamel::client
