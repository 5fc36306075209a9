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

TEST(BenchScenes, TheSameSeedGivesTheSameScene) {
  const auto robots = bench_robots(ArmModel::prototype);
  ASSERT_TRUE(robots);
  const auto all = cells({}, {});
  ASSERT_TRUE(all);
  for (const Cell& cell : all.value()) {
    const scene::Scene a = draw_scene(cell, robots.value(), 7, 3), b = draw_scene(cell, robots.value(), 7, 3);
    EXPECT_EQ(a.q0, b.q0) << cell.family;
    EXPECT_EQ(a.goal->X_WG.p, b.goal->X_WG.p);
    EXPECT_EQ(a.perception.obstacles.size(), static_cast<std::size_t>(cell.spheres));
    EXPECT_NE(draw_scene(cell, robots.value(), 8, 3).q0, a.q0);
    scene::Scene s = a;
    s.planner = settings(cell, scene::Method::gyro);
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
      scene::Scene s = draw_scene(cell, robots.value(), 11, static_cast<std::size_t>(k));
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

}  // namespace
}  // namespace hamel::client
