// Whatever comes in: finite torques, the same bits for the same input, nothing from the heap, memory that
// continues.
#include <gtest/gtest.h>

#include <cstring>

#include "common/rbd/rbd.h"
#include "common/scene/self_links.h"
#include "tests/support/no_alloc.h"
#include "tests/support/planner_scene.h"
#include "tests/support/soak.h"

namespace hamel::test {
namespace {

using Eigen::Vector3d;
using planner::Input;
using planner::Memory;
using planner::Output;
using planner::Planner;
using planner::Reason;
using planner::State;
using scene::Method;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

scene::Robot random_robot(Random& rng, int n) {
  scene::Robot robot{"random", "", random_chain(rng, n), {}};
  for (int i = 0; i < n; ++i) {
    const double radius = rng.coin(0.2) ? 0 : rng.uniform(0, 0.1);
    const Vector3d a = rng.vec3(0.2);
    const Vector3d b = rng.coin(0.1) ? a : rng.vec3(0.3);  // some capsules have no length
    robot.shapes.push_back(link_capsule(i, a, b, radius));
    if (rng.coin(0.3))
      robot.shapes.push_back({i, {geometry::ShapeKind::box, {0.1, 0.2, 0.05}}, rng.pose(0.2)});
  }
  if (n >= 3 && rng.coin(0.5)) scene::watch(robot, {{0, n - 1}});
  return robot;
}

scene::PlannerOptions random_options(Random& rng, Method method) {
  scene::PlannerOptions o;
  o.method = method;
  o.gain_form = static_cast<scene::GainForm>(static_cast<int>(rng.uniform(0, 4)));
  o.mapping = static_cast<scene::Mapping>(static_cast<int>(rng.uniform(0, 3)));
  o.pairs = rng.coin(0.5) ? scene::PairPolicy::all : scene::PairPolicy::nearest;
  o.relative_velocity = rng.coin(0.5);
  o.lambda2_relative = rng.coin(0.5);
  o.rho0_m = rng.coin(0.1) ? 1e6 : rng.uniform(0.05, 1);
  o.barrier_gain = rng.coin(0.7) ? 12 : 0;
  o.kc = rng.coin(0.7) ? 2 : 0;
  o.limit_weight = rng.coin(0.5) ? 100 : 0;
  o.vmax_mps = rng.coin(0.5) ? 0.5 : scene::kInf;
  o.amax = rng.coin(0.2) ? 5 : scene::kInf;
  o.assumed_speed_mps = 0.5;
  if (rng.coin(0.3)) o.unreachable = scene::Unreachable::approach;
  return o;
}

geometry::Obstacle random_obstacle(Random& rng, const rbd::Workspace& ws) {
  geometry::Obstacle o;
  o.id = static_cast<std::uint32_t>(rng.uniform(0, 6));  // duplicates
  o.shape.kind = static_cast<geometry::ShapeKind>(static_cast<int>(rng.uniform(0, 5)));
  o.shape.dims_m = rng.coin(0.1) ? Vector3d::Zero() : Vector3d(rng.vec3(0.3).cwiseAbs());
  o.X_WO = rng.pose(1.5);
  const auto link = static_cast<std::size_t>(rng.uniform(0, static_cast<double>(ws.X_WB.size())));
  if (rng.coin(0.2)) o.X_WO.p = ws.X_WB[link].p;  // on the joint, so often on the axis of a link
  if (rng.coin(0.5)) o.V_WO << rng.vec3(1), rng.vec3(1);
  o.velocity_known = rng.coin(0.8);
  if (rng.coin(0.02)) o.V_WO[4] = rng.coin(0.5) ? 1e9 : kNaN;
  if (rng.coin(0.02)) o.V_WO[1] = 1e9;
  o.sigma_m = rng.coin(0.3) ? 0.01 : 0;
  if (rng.coin(0.02)) o.X_WO.p[0] = kNaN;
  if (rng.coin(0.02)) o.shape.dims_m[0] = rng.coin(0.5) ? -1 : scene::kInf;
  return o;
}

struct Fuzz {
  Eigen::VectorXd q, qd;
  std::vector<geometry::Obstacle> obstacles;
  double dt_s, obstacle_age_s, state_age_s;
};

Fuzz random_cycle(Random& rng, const model::Chain& chain, rbd::Workspace& ws) {
  const int n = chain.n();
  Fuzz f{rng.vector(n, 3),
         rng.vector(n, rng.coin(0.05) ? 100 : 2),
         {},
         std::pow(10, rng.uniform(-5, -1.3)),
         0,
         0};
  if (rng.coin(0.2)) f.qd.setZero();
  if (rng.coin(0.1)) f.q.setZero();
  rbd::positions(chain, f.q, ws);
  const int count = static_cast<int>(rng.uniform(0, 6));
  for (int k = 0; k < count; ++k) f.obstacles.push_back(random_obstacle(rng, ws));
  if (!f.obstacles.empty() && rng.coin(0.2)) f.obstacles.push_back(f.obstacles.front());
  if (rng.coin(0.1)) f.obstacle_age_s = rng.coin(0.2) ? scene::kInf : rng.uniform(0, 0.4);
  if (rng.coin(0.02)) f.obstacle_age_s = kNaN;
  if (rng.coin(0.05)) f.state_age_s = rng.coin(0.2) ? kNaN : rng.uniform(0, 0.1);
  if (rng.coin(0.01)) f.q[0] = kNaN;
  if (rng.coin(0.01)) f.qd[n - 1] = -scene::kInf;
  if (rng.coin(0.01)) f.dt_s = rng.coin(0.5) ? 0 : kNaN;
  return f;
}

Input input(const Fuzz& f, std::uint64_t k) {
  return {.step = k,
          .t_s = 0.01 * static_cast<double>(k),
          .dt_s = f.dt_s,
          .q = f.q,
          .qd = f.qd,
          .obstacles = f.obstacles,
          .obstacle_age_s = f.obstacle_age_s,
          .state_age_s = f.state_age_s,
          .obstacles_expected = true};
}

scene::Goal random_goal(Random& rng, int n, std::uint64_t id) {
  scene::Goal goal;
  goal.id = id;
  goal.kind = static_cast<scene::GoalKind>(static_cast<int>(rng.uniform(0, 3)));
  goal.X_WG = rng.pose(1);
  if (rng.coin(0.3)) goal.V_WG << rng.vec3(0.2), rng.vec3(0.2);
  goal.joints = rng.vector(n, 3);
  if (rng.coin(0.05)) goal.X_WG.p[1] = kNaN;
  if (rng.coin(0.05)) goal.joints[0] = kNaN;
  if (rng.coin(0.05)) goal.V_WG[4] = 1e6;
  return goal;
}

bool finite(const planner::Report& r) {
  bool ok = std::isfinite(r.target_error_m) && std::isfinite(r.orientation_error_rad) &&
            std::isfinite(r.speed_mps) && r.end_effector_m.allFinite() && !std::isnan(r.clearance_m) &&
            !std::isnan(r.clearance_min_m) && std::isfinite(r.path_length_m) &&
            std::isfinite(r.gyroscopic_power_W) && std::isfinite(r.injected_power_W) &&
            std::isfinite(r.kinetic_J) && std::isfinite(r.attraction_J) && std::isfinite(r.tank_J) &&
            !std::isnan(r.self_clearance_m);
  for (const auto& l : r.links)
    ok = ok && !std::isnan(l.distance_m) && l.point_on_link_m.allFinite() &&
         l.point_on_obstacle_m.allFinite() && std::isfinite(l.closing_speed_mps) &&
         std::isfinite(l.phi_rad) && l.gate >= 0 && l.gate <= 1 && l.gyroscopic_N.allFinite() &&
         l.repulsive_N.allFinite() && std::isfinite(l.barrier_multiplier);
  return ok;
}

bool same_bits(const Output& a, const Output& b) {
  return std::memcmp(a.torque_Nm.data(), b.torque_Nm.data(),
                     static_cast<std::size_t>(a.torque_Nm.size()) * 8) == 0;
}

class ForMethod : public testing::TestWithParam<Method> {};

// Two planners fed the same, one of them interrupted: its memory goes through bytes into a fresh planner
// every while.
TEST_P(ForMethod, FuzzedCyclesStayFiniteRepeatAndContinueFromMemory) {
  Random rng(11 + static_cast<unsigned>(GetParam()));
  std::uint64_t moving = 0, nans = 0;
  const int robots = soak() ? 250 : 25;  // a million cycles over the four methods
  for (int robot_index = 0; robot_index < robots; ++robot_index) {
    const int n = 1 + robot_index % 8;
    const scene::Robot robot = random_robot(rng, n);
    const scene::PlannerOptions o = random_options(rng, GetParam());
    Planner steady(robot, o), interrupted(robot, o);
    Output a = steady.output(), b = interrupted.output();
    rbd::Workspace ws(robot.chain);
    scene::Goal goal = random_goal(rng, n, 1);
    Fuzz f = random_cycle(rng, robot.chain, ws);
    for (std::uint64_t k = 0; k < 1000; ++k) {
      if (k % 200 == 50) goal = random_goal(rng, n, k);
      if (k % 50 == 0) {
        std::array<std::byte, sizeof(Memory)> bytes;
        std::memcpy(bytes.data(), &interrupted.memory(), sizeof(Memory));
        interrupted = Planner(robot, o);
        Memory saved;
        std::memcpy(&saved, bytes.data(), sizeof(Memory));
        interrupted.restore(saved);
      }
      steady.set_goal(goal);
      interrupted.set_goal(goal);
      if (rng.coin(0.3)) f = random_cycle(rng, robot.chain, ws);  // else the same again: holds stay alive
      steady.plan(input(f, k), a);
      interrupted.plan(input(f, k), b);
      if (k % 40 == 20) {  // an answer, asked for or not
        const Eigen::VectorXd waypoint = rng.coin(0.7) ? rng.vector(n, 2) : Eigen::VectorXd();
        steady.take_escape(waypoint, input(f, k).t_s);
        interrupted.take_escape(waypoint, input(f, k).t_s);
      }
      ASSERT_TRUE(a.torque_Nm.allFinite()) << "robot " << robot_index << " cycle " << k;
      ASSERT_TRUE(finite(a.report)) << "robot " << robot_index << " cycle " << k;
      ASSERT_TRUE(same_bits(a, b)) << "robot " << robot_index << " cycle " << k;
      ASSERT_EQ(std::memcmp(&steady.memory(), &interrupted.memory(), sizeof(Memory)), 0);
      moving += a.report.state == State::moving;
      nans += a.report.reason == Reason::non_finite;
    }
  }
  EXPECT_GT(moving, 2000u);
  EXPECT_GT(nans, 100u);
}

TEST_P(ForMethod, AllocatesNothing) {
  if (!NoAlloc::supported()) GTEST_SKIP();
  Random rng(21);
  for (int n : {1, 7, 30}) {
    const scene::Robot robot = random_robot(rng, n);
    Planner p(robot, random_options(rng, GetParam()));
    Output out = p.output();
    rbd::Workspace ws(robot.chain);
    p.set_goal(random_goal(rng, n, 1));
    for (std::uint64_t k = 0; k < 300; ++k) {
      const Fuzz f = random_cycle(rng, robot.chain, ws);
      const Input in = input(f, k);
      const NoAlloc guard;
      p.plan(in, out);
      ASSERT_EQ(guard.calls(), 0) << "n " << n << " cycle " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, ForMethod,
                         testing::Values(Method::attract, Method::khatib, Method::gyro_paper, Method::gyro));

TEST(NoAlloc, CatchesEigen) {  // a guard that never failed proves nothing
  if (!NoAlloc::supported()) GTEST_SKIP();
  const NoAlloc guard;
  const Eigen::VectorXd v = Eigen::VectorXd::Ones(10);
  EXPECT_GE(guard.calls(), 1) << v.sum();
}

TEST(Planner, DoesNotCareInWhichOrderObstaclesArrive) {
  Random rng(5);
  const scene::Robot robot = random_robot(rng, 6);
  scene::PlannerOptions o = random_options(rng, Method::gyro);
  o.barrier_gain = 12, o.kc = 2, o.rho0_m = 0.5;
  Planner p(robot, o), r(robot, o);
  Output a = p.output(), b = r.output();
  const scene::Goal goal = random_goal(rng, 6, 1);
  p.set_goal(goal);
  r.set_goal(goal);
  rbd::Workspace ws(robot.chain);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    Fuzz f = random_cycle(rng, robot.chain, ws);
    for (std::size_t i = 0; i < f.obstacles.size(); ++i) f.obstacles[i].id = static_cast<std::uint32_t>(i);
    r.restore(p.memory());
    Fuzz g = f;
    std::reverse(g.obstacles.begin(), g.obstacles.end());
    p.plan(input(f, k), a);
    r.plan(input(g, k), b);
    ASSERT_TRUE(same_bits(a, b)) << k;
  }
}

TEST(Planner, ManyObstaclesActOnTheNearestAndSaySo) {
  const scene::Robot robot = planar_arm(4, 1, 0.05);
  scene::PlannerOptions o;
  o.rho0_m = 10;
  o.barrier_gain = 12;
  std::vector<geometry::Obstacle> many;
  Random rng(6);
  for (std::uint32_t i = 0; i < 4096; ++i)
    many.push_back(sphere(i, {rng.uniform(-4, 4), rng.uniform(1, 4), 0}, 0.01));
  Planner p(robot, o);
  Output out = p.output();
  const Eigen::VectorXd q = Eigen::VectorXd::Zero(4);
  p.plan({.q = q, .qd = q, .obstacles = many}, out);
  EXPECT_EQ(out.report.pairs_in_range, static_cast<int>(planner::kMaxPairs));
  EXPECT_EQ(out.report.pairs_dropped, 4 * 4096 - 256);
  many.push_back(sphere(5000, {5, 5, 0}, 0.01));
  p.plan({.q = q, .qd = q, .obstacles = many}, out);
  EXPECT_EQ(out.report.state, State::fault);
}

}  // namespace
}  // namespace hamel::test
