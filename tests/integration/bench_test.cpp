// The pieces of `hamel bench`: distribution of work, the judge of contact, the random scenes, and a small
// subset of what the bench measures.
#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "clients/hamel/batch.h"
#include "clients/hamel/bench_families.h"
#include "clients/hamel/bench_tally.h"
#include "clients/hamel/judge.h"
#include "clients/hamel/trial.h"
#include "tests/support/planner_scene.h"

namespace hamel::client {
namespace {

TEST(Batch, HandsResultsOverInOrderWhateverTheThreads) {
  for (const int workers : {1, 2, 7}) {
    std::vector<std::size_t> seen;
    const std::size_t n = run_batch(
        Batch{.jobs = 100, .workers = workers}, [](std::size_t i) { return i * i; },
        [&](std::size_t i, std::size_t square) {
          EXPECT_EQ(square, i * i);
          seen.push_back(i);
        });
    EXPECT_EQ(n, 100u);
    std::vector<std::size_t> all(100);
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(seen, all);
  }
}

TEST(Batch, AnEarlyStopLeavesTheFirstOnes) {
  std::atomic<int> begun{0};
  std::size_t taken = 0;
  const std::size_t n = run_batch(
      Batch{.jobs = 1000, .workers = 3, .stop = [&] { return begun >= 10; }},
      [&](std::size_t i) {
        ++begun;
        return i;
      },
      [&](std::size_t i, std::size_t) { EXPECT_EQ(i, taken++); });
  EXPECT_EQ(n, static_cast<std::size_t>(begun));
  EXPECT_EQ(n, taken);
  EXPECT_LT(n, 20u);
}

TEST(Batch, AnExceptionComesOutOnTheCaller) {
  const auto work = [](std::size_t i) {
    if (i == 5) throw std::runtime_error("five");
    return i;
  };
  EXPECT_THROW(run_batch(Batch{.jobs = 50, .workers = 2}, work, [](std::size_t, std::size_t) {}),
               std::runtime_error);
}

TEST(Tally, WilsonsIntervalIsThePublishedOne) {
  const Rate none = wilson(0, 1000), half = wilson(50, 100);
  EXPECT_EQ(none.low, 0);
  EXPECT_NEAR(none.high, 0.003827, 1e-6);
  EXPECT_NEAR(half.low, 0.403832, 1e-6);
  EXPECT_NEAR(half.high, 0.596168, 1e-6);
}

/// One link of 1 m along x that turns about z, a capsule of 5 cm.
scene::Robot one_link() {
  scene::Robot r = test::planar_arm(1, 0.1, 0.05);
  return r;
}

TEST(Judge, SeesWhatIsPassedBetweenTwoStates) {
  Judge judge(one_link());
  const std::vector thin{test::sphere(3, {0.9, 0, 0}, 0.002)};
  Eigen::VectorXd q(1);
  q[0] = -0.3;
  EXPECT_EQ(judge.advance(0, q, thin), nullptr);
  q[0] = 0.3;  // over it in one step
  const Contact* c = judge.advance(0.05, q, thin);
  ASSERT_NE(c, nullptr);
  EXPECT_EQ(c->other, 3u);
  EXPECT_TRUE(c->arm_caused);
  EXPECT_GT(c->t_s, 0);
  EXPECT_LT(c->t_s, 0.05);
}

TEST(Judge, AnArmThatStandsCausesNothing) {
  Judge judge(one_link());
  const Eigen::VectorXd q = Eigen::VectorXd::Zero(1);
  const Contact* c = nullptr;
  for (int k = 0; k <= 100 && !c; ++k) {
    const double t = 0.01 * k;
    c = judge.advance(t, q, std::vector{test::sphere(1, {0.5, 1 - t, 0}, 0.1)});
    if (c) {
      EXPECT_NEAR(t, 0.85, 0.011);
    }
  }
  ASSERT_NE(c, nullptr);
  EXPECT_FALSE(c->arm_caused);
  EXPECT_LE(judge.clearance_min_m(), 0.001);
}

// A recording may begin with somebody where the arm is.
TEST(Judge, WhatAppearsWhereAMovingArmIsWasNotRunInto) {
  const std::vector there{test::sphere(3, {0.9, 0, 0}, 0.1)};
  for (const int seen_from : {0, 3, 10})
    for (const int seen_to : {4, 10}) {  // out of sight for a while is not new
      Judge judge(one_link());
      Eigen::VectorXd q = Eigen::VectorXd::Constant(1, -0.3);
      for (int k = 0; k < 10; ++k, q[0] += 0.03)
        judge.advance(0.01 * k, q, std::span(there).first(k >= seen_from && k < seen_to ? 1 : 0));
      const Contact* c = judge.advance(0.1, q, there);
      ASSERT_NE(c, nullptr);
      EXPECT_EQ(c->arm_caused, seen_from < 10) << seen_from << " " << seen_to;
    }
}

TEST(Judge, FindsTheSmallestDistance) {
  Judge judge(one_link());
  Eigen::VectorXd q(1);
  for (int k = 0; k <= 200; ++k) {
    q[0] = 0.005 * k;
    judge.advance(0.01 * k, q,
                  std::vector{test::sphere(1, {1.2 * std::cos(0.5), 1.2 * std::sin(0.5), 0}, 0.1)});
  }
  EXPECT_NEAR(judge.clearance_min_m(), 0.05, 0.002);
}

scene::Scene drawn(const Cell& cell, const BenchRobots& robots, std::uint64_t seed, std::size_t index) {
  return draw_scene(cell, robots, seed, index).value();
}

// Some of the Panda's links are 18 mm apart however it stands.
TEST(BenchScenes, AnArmThatMustNotTouchItselfIsDrawnToo) {
  const auto robots = bench_robots(ArmModel::full);
  ASSERT_TRUE(robots);
  Judge judge(robots.value().panda);
  for (const auto& [family, spheres] :
       {std::pair{"panda_static", 16}, std::pair{"panda_moving", 8}, std::pair{"panda_crowd", 256}}) {
    const auto s = draw_scene({family, spheres, ""}, robots.value(), 7, 0);
    ASSERT_TRUE(s) << family;
    EXPECT_GT(judge.self_clearance(s.value().q0),
              settings({family, spheres, ""}, scene::Method::gyro).dmin_m);
  }
}

TEST(BenchScenes, WhereNothingFitsThereIsAProblem) {
  auto robots = bench_robots(ArmModel::prototype);
  ASSERT_TRUE(robots);
  scene::Robot& panda = robots.value().panda;
  panda.self_pairs = {{0, 0}};  // touches itself everywhere
  EXPECT_FALSE(draw_scene({"panda_static", 1, ""}, robots.value(), 7, 0));
  int asked = 0;
  EXPECT_FALSE(draw_scene({"panda_static", 1, ""}, robots.value(), 7, 0, [&] { return ++asked > 3; }));
  EXPECT_EQ(asked, 4);
}

TEST(BenchScenes, TheSameSeedGivesTheSameScene) {
  const auto robots = bench_robots(ArmModel::prototype);
  ASSERT_TRUE(robots);
  const auto all = cells({}, {});
  ASSERT_TRUE(all);
  for (const Cell& cell : all.value()) {
    const scene::Scene a = drawn(cell, robots.value(), 7, 3), b = drawn(cell, robots.value(), 7, 3);
    EXPECT_EQ(a.q0, b.q0) << cell.family;
    EXPECT_EQ(a.goal->X_WG.p, b.goal->X_WG.p);
    EXPECT_EQ(a.perception.obstacles.size(), static_cast<std::size_t>(cell.spheres));
    if (!has_own_step(cell)) {
      EXPECT_NE(drawn(cell, robots.value(), 8, 3).q0, a.q0);
    }
    scene::Scene s = a;
    s.planner = settings(cell, scene::Method::gyro, 3);
    EXPECT_TRUE(scene::problems(s).empty()) << cell.family;
  }
}

/// Part of what `hamel bench planner` measures, with literal seeds.
TEST(BenchSubset, GyroReachesAndTouchesNothing) {
  const auto robots = bench_robots(ArmModel::prototype);
  ASSERT_TRUE(robots);
  for (const auto& [family, spheres, scenes, least] :
       {std::tuple{"panda_static", 8, 30, 27}, std::tuple{"panda_moving", 4, 30, 26},
        std::tuple{"planar_static", 4, 30, 28}}) {
    const Cell cell{family, spheres, ""};
    int reached = 0, touched = 0;
    for (int k = 0; k < scenes; ++k) {
      scene::Scene s = drawn(cell, robots.value(), 11, static_cast<std::size_t>(k));
      s.planner = settings(cell, scene::Method::gyro);
      const Trial t = run_trial(s);
      reached += t.ending == Ending::reached;
      touched += t.ending == Ending::collided;
      EXPECT_TRUE(t.contact_reported) << family << " " << k;
    }
    EXPECT_GE(reached, least) << family;
    EXPECT_EQ(touched, 0) << family;
  }
}

// Each value of each axis of the grid at least once.
TEST(BenchSubset, GyroReachesOverTheGridOfExample52) {
  const auto robots = bench_robots(ArmModel::prototype);
  ASSERT_TRUE(robots);
  for (const char* variant : {"vmax 1", "no vmax"})
    for (std::size_t k = 0; k < 192; k += 31) {
      const Cell cell{"example_5_2_grid", 1, variant};
      scene::Scene s = drawn(cell, robots.value(), 1, k);
      s.planner = settings(cell, scene::Method::gyro, k);
      const Trial t = run_trial(s);
      EXPECT_EQ(t.ending, Ending::reached) << variant << " " << k << ": " << to_string(t.ending);
    }
}

// Nothing is told of the obstacles any more while the arm is on its way: it says so and stands.
TEST(BenchSubset, ArmsStopWhenTheObstacleStreamEnds) {
  for (const ArmModel model : {ArmModel::prototype, ArmModel::full}) {
    const auto robots = bench_robots(model);
    ASSERT_TRUE(robots);
    const Cell cell{"panda_moving", 1, ""};
    int moving = 0;
    for (std::size_t k = 0; k < 10; ++k) {
      scene::Scene s = drawn(cell, robots.value(), 5, k);
      s.planner = settings(cell, scene::Method::gyro);
      TrialOptions o;
      o.dropout_s = 0.3 + 0.1 * static_cast<double>(k);
      const Trial t = run_trial(s, o);
      if (!t.dropout || t.ending == Ending::collided) continue;
      moving += t.dropout->speed_radps > kStill_radps;
      EXPECT_TRUE(t.dropout->told) << k;
      EXPECT_LE(t.dropout->stop_s, std::max(0.1, t.dropout->least_s)) << k;
    }
    EXPECT_GE(moving, 8);
  }
}

}  // namespace
}  // namespace hamel::client
