// Exact reductions leave results as they are: every shipped scene, and random ones, against full fidelity.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "clients/hamel/ticks.h"
#include "common/files/scene_text.h"
#include "common/rbd/planar_chain.h"
#include "common/scene/locked.h"
#include "common/scene/reduce.h"
#include "services/planner/core/pairs.h"
#include "tests/support/reduce_scene.h"

namespace hamel {
namespace {

using client::Ticks;
using Eigen::VectorXd;

/// What a run came to.
struct Run {
  std::vector<VectorXd> q;  ///< at 20 instants
  std::vector<planner::Report> reports;
  VectorXd torque_sum;
  std::uint64_t same_commands = 0;  ///< a sum of all torques' bits
};

Run run(const scene::Scene& s) {
  Ticks ticks(s);
  Run out;
  const auto steps = static_cast<std::uint64_t>(std::llround(s.duration_s / s.dynamics.dt_s));
  const std::uint64_t every = std::max<std::uint64_t>(1, steps / 20);
  for (std::uint64_t k = 1; k <= steps; ++k) {
    ticks.plan();
    for (const double tau : ticks.torque_Nm()) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &tau, sizeof bits);
      out.same_commands = (out.same_commands ^ bits) * 1099511628211ull;
    }
    if (!ticks.step()) break;
    if (k % every != 0) continue;
    out.q.push_back(ticks.arm().state().q);
    out.reports.push_back(ticks.report());
  }
  return out;
}

scene::Scene as(scene::Scene s, scene::Fidelity fidelity) {
  s.reduce.fidelity = fidelity;
  scene::reduce(s);
  return s;
}

/// The moving joints of a full configuration.
VectorXd moving(const VectorXd& q, const std::vector<std::optional<double>>& at) {
  std::vector<double> out;
  for (std::size_t i = 0; i < at.size(); ++i)
    if (!at[i]) out.push_back(q[static_cast<Eigen::Index>(i)]);
  return Eigen::Map<VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
}

/// Trajectories apart by no more than 10 times what a one-ulp change of the start grows to; outcomes the
/// same.
void expect_equal(const scene::Scene& written) {
  const auto at = scene::locked_values(written);
  const scene::Scene full = as(written, scene::Fidelity::full), exact = as(written, scene::Fidelity::exact);
  scene::Scene nudged = full;
  for (Eigen::Index i = 0; i < nudged.q0.size(); ++i)
    nudged.q0[i] = std::nextafter(nudged.q0[i] == 0 ? 1e-16 : nudged.q0[i], 10.0);
  const Run a = run(full), b = run(exact), c = run(nudged);
  ASSERT_EQ(a.q.size(), b.q.size());
  double grown = 1e-15, apart = 0;
  for (std::size_t k = 0; k < std::min(a.q.size(), c.q.size()); ++k) {
    grown = std::max(grown, (a.q[k] - c.q[k]).lpNorm<Eigen::Infinity>());
    apart = std::max(apart, (moving(a.q[k], at) - b.q[k]).lpNorm<Eigen::Infinity>());
    EXPECT_LE(apart, 10 * grown + 1e-13 * (1 + b.q[k].lpNorm<Eigen::Infinity>())) << "instant " << k;
    if (grown > 1e-6) break;  // chaos: what follows is another run
    const planner::Report &x = a.reports[k], &y = b.reports[k];
    EXPECT_EQ(x.state, y.state);
    EXPECT_EQ(x.reason, y.reason);
    EXPECT_EQ(x.contacts, y.contacts);
    EXPECT_EQ(x.pairs_in_range, y.pairs_in_range);
    // An arm of fewer joints has a smaller workspace, and farther from it than kSeen_m nothing is seen.
    const bool smaller = full.robot.chain.n() != exact.robot.chain.n();
    const double seen = smaller ? planner::kSeen_m : std::numeric_limits<double>::max();
    EXPECT_NEAR(std::min(x.clearance_m, seen), std::min(y.clearance_m, seen), 100 * grown + 1e-12);
  }
  scene::Scene linked = exact;
  linked.reduce.links = scene::Choice::on;
  EXPECT_EQ(run(linked).same_commands, b.same_commands) << "links left out leave every bit of the command";
  const bool same_arm = full.robot.chain.n() == exact.robot.chain.n() && !rbd::is_planar(exact.robot.chain) &&
                        full.robot.chain.gravity_W_mps2() == exact.robot.chain.gravity_W_mps2();
  if (same_arm) {
    EXPECT_EQ(a.same_commands, b.same_commands) << "obstacles left out leave every bit";
  }
}

TEST(ExactReductions, LeaveEveryShippedSceneAsItIs) {
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes")) {
    auto scene = files::read_scene(entry.path().string());
    ASSERT_TRUE(scene);
    SCOPED_TRACE(scene.value().name);
    scene.value().duration_s = std::min(scene.value().duration_s, 4.0);
    expect_equal(scene.value());
  }
}

/// How a whole run ends.
struct Ending {
  planner::Report report;
  double t_s = 0;
};

Ending ending(const scene::Scene& s) {
  Ticks ticks(s);
  while (!ticks.done()) {
    ticks.plan();
    if (!ticks.step()) break;
  }
  return {ticks.report(), ticks.arm().t_s()};
}

/// Run to their ends the six scenes come to the same: state, reason, time, contacts, clearance.
TEST(ExactReductions, LeaveTheOutcomeOfEveryShippedSceneAsItIs) {
  int scenes = 0, reached = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes")) {
    auto read = files::read_scene(entry.path().string());
    ASSERT_TRUE(read);
    const scene::Scene& s = read.value();
    SCOPED_TRACE(s.name);
    const Ending full = ending(as(s, scene::Fidelity::full)), exact = ending(as(s, scene::Fidelity::exact));
    EXPECT_EQ(full.report.state, exact.report.state);
    EXPECT_EQ(full.report.reason, exact.report.reason);
    EXPECT_EQ(full.report.contacts, exact.report.contacts);
    EXPECT_EQ(full.t_s, exact.t_s);
    if (std::isfinite(full.report.clearance_min_m)) {
      EXPECT_NEAR(full.report.clearance_min_m, exact.report.clearance_min_m, 1e-9);
    }
    ++scenes;
    reached += exact.report.state == planner::State::reached;
  }
  EXPECT_EQ(scenes, 6);
  EXPECT_GE(reached, 2);
}

class RandomScenes : public test::ForSeed {};
INSTANTIATE_TEST_SUITE_P(ExactReductions, RandomScenes, testing::Range(0u, 100u));

TEST_P(RandomScenes, StayAsTheyAre) {
  expect_equal(test::random_scene(rng, GetParam() % 2 == 0, GetParam() % 4 == 0 ? 0.3 : 0));
}

/// An arm whose first joint is locked among obstacles that stand, some of them in or near what is then part
/// of the base: contact and clearance are those of the arm as written.
TEST(ExactReductions, WatchWhatIsLockedOntoTheBase) {
  test::Random rng(83);
  int touched = 0, nearest = 0;
  for (int k = 0; k < 200; ++k) {
    SCOPED_TRACE(k);
    scene::Scene s = test::random_scene(rng, false, 0);
    s.locked = {{s.robot.chain.joint(0).name, {}}};
    if (s.robot.chain.n() > 2 && rng.coin(0.5)) s.locked.push_back({s.robot.chain.joint(1).name, {}});
    s.perception.obstacles.clear();
    rbd::Workspace ws(s.robot.chain);
    rbd::positions(s.robot.chain, s.q0, ws);
    const std::uint32_t count = k % 2 == 0 ? 4 : 30;  // many are sifted about the arm
    for (std::uint32_t id = 1; id <= count; ++id) {
      scene::ScriptedObstacle o;
      o.at_start = test::sphere(id, ws.X_WB[0].p + rng.uniform(0.1, 0.2 * count) * rng.unit(), 0.05);
      s.perception.obstacles.push_back(o);
    }
    const auto first = [](const scene::Scene& of) {
      Ticks ticks(of);
      ticks.plan();
      return ticks.report();
    };
    const scene::Scene exact = as(s, scene::Fidelity::exact);
    const planner::Report x = first(as(s, scene::Fidelity::full)), y = first(exact);
    EXPECT_EQ(x.reason == planner::Reason::contact, y.reason == planner::Reason::contact);
    EXPECT_EQ(x.contacts, y.contacts);
    EXPECT_NEAR(std::min(x.clearance_m, planner::kSeen_m), std::min(y.clearance_m, planner::kSeen_m), 1e-9);
    scene::Scene unwatched = exact;
    for (scene::LinkShape& shape : unwatched.robot.shapes) shape.was_link = false;
    const planner::Report z = first(unwatched);
    touched += y.contacts > z.contacts;
    nearest += y.clearance_m < z.clearance_m;
  }
  EXPECT_GT(touched, 10);
  EXPECT_GT(nearest, 30);
}

/// A planner behind a view of obstacle sets, and the arm that it drives; as the service has them.
struct Side {
  explicit Side(const scene::Scene& s)
      : scene(s),
        planner(scene.robot, scene.planner, planner::savings(scene)),
        view(scene),
        arm(scene.robot.chain, scene.dynamics),
        state(arm.start(scene.q0, scene.qd0)),
        out(planner.output()) {
    planner.set_goal(*scene.goal);
  }
  bool step() {
    wire::Causes causes;
    const double t_s = static_cast<double>(state.step) * scene.dynamics.dt_s;
    const double age_s = view.at(t_s, state.q, causes);
    planner::Input in{.step = state.step,
                      .t_s = t_s,
                      .dt_s = scene.dynamics.dt_s,
                      .q = state.q,
                      .qd = state.qd,
                      .obstacles = view.obstacles(),
                      .obstacle_age_s = age_s,
                      .obstacle_set = view.set(),
                      .obstacles_expected = true,
                      .link_floor_m = view.link_floor_m()};
    planner.plan(in, out);
    in.obstacles = view.all();
    asked = planner.escape_question(in);
    return arm.step(state, out.torque_Nm).usable();
  }
  const scene::Scene scene;
  planner::Planner planner;
  planner::ObstacleView view;
  dynamics::Integrator arm;
  dynamics::State state;
  planner::Output out;
  planner::EscapeQuestion asked;
};

void expect_same(const planner::Report& x, const planner::Report& y) {
  EXPECT_EQ(x.state, y.state);
  EXPECT_EQ(x.reason, y.reason);
  EXPECT_EQ(x.contacts, y.contacts);
  EXPECT_EQ(x.clearance_m, y.clearance_m);
  EXPECT_EQ(x.clearance_min_m, y.clearance_min_m);
  EXPECT_EQ(x.pairs_in_range, y.pairs_in_range);
  EXPECT_EQ(x.barrier_rows, y.barrier_rows);
  EXPECT_EQ(x.velocities_estimated, y.velocities_estimated);
  EXPECT_EQ(x.velocities_unknown, y.velocities_unknown);
  EXPECT_EQ(x.tank_J, y.tank_J);
  for (std::size_t i = 0; i < x.links.size(); ++i) {
    EXPECT_EQ(x.links[i].distance_m, y.links[i].distance_m) << "link " << i;
    EXPECT_EQ(x.links[i].obstacle, y.links[i].obstacle);
    EXPECT_EQ(x.links[i].point_on_link_m, y.links[i].point_on_link_m);
    EXPECT_EQ(x.links[i].barrier_multiplier, y.links[i].barrier_multiplier);
  }
}

/// What comes from outside may be anything: velocities that are not told, turning boxes, half-spaces, balls
/// that fly at the base; links are boxes and cylinders too, and watched against each other.
TEST_P(RandomScenes, MeetWhateverComesWithTheSameBits) {
  scene::Scene s = test::random_scene(rng, false, 0);
  test::clothe(s.robot, rng);
  std::vector<geometry::Obstacle> all;
  for (const scene::ScriptedObstacle& o : s.perception.obstacles) {
    all.push_back(o.at_start);
    all.back().V_WO.tail<3>() = o.velocity_mps;
    if (rng.coin(0.2)) all.back().velocity_known = false;
    if (rng.coin(0.1)) all.back().V_WO.head<3>() = rng.vec3(2);
  }
  const Eigen::Vector3d base = s.robot.chain.X_WB0().p;
  if (rng.coin(0.5)) {  // something lies over the target
    s.goal->kind = scene::GoalKind::pose;
    s.goal->X_WG.R = lie::exp_so3(rng.vec3(2));
    all.push_back(test::sphere(99, s.goal->X_WG.p + rng.vec3(0.3), 0.1));
  }
  for (std::uint32_t id = 100; id < 103; ++id) {
    const Eigen::Vector3d way = rng.unit();
    all.push_back(test::sphere(id, base + rng.uniform(0.3, 1) * way, 0.1, -rng.uniform(0.5, 3) * way));
    all.back().velocity_known = id != 102;
  }
  geometry::Obstacle floor;
  floor.id = 200;
  floor.shape.kind = geometry::ShapeKind::half_space;
  floor.X_WO = {lie::exp_so3(rng.vec3(0.2)), base - Eigen::Vector3d(0, 0, rng.uniform(0.5, 3))};
  if (rng.coin(0.5)) all.push_back(floor);
  std::vector<geometry::Obstacle> shown = all;

  Side full(as(s, scene::Fidelity::full)), exact(as(s, scene::Fidelity::exact));
  int met = 0;
  for (int k = 0; k < 200; ++k) {
    if (k % 16 == 0) {  // a set about each 30 ms, not always whole
      wire::ObstacleSet set;
      set.t_s = k * s.dynamics.dt_s, set.next_t_s = set.t_s + 16 * s.dynamics.dt_s;
      set.obstacles = shown;
      if (rng.coin(0.2) && !set.obstacles.empty()) set.obstacles.erase(set.obstacles.begin());
      full.view.add(set), exact.view.add(set);
      for (geometry::Obstacle& o : shown) o.X_WO.p += 16 * s.dynamics.dt_s * o.V_WO.tail<3>();
    }
    const bool went = full.step();
    ASSERT_EQ(went, exact.step());
    if (!went) break;
    ASSERT_EQ(full.out.torque_Nm, exact.out.torque_Nm) << "step " << k;
    expect_same(full.out.report, exact.out.report);
    ASSERT_EQ(full.asked.obstacles.size(), exact.asked.obstacles.size());
    for (std::size_t i = 0; i < full.asked.obstacles.size(); ++i)
      EXPECT_EQ(full.asked.obstacles[i].X_WO.p, exact.asked.obstacles[i].X_WO.p);
    met += full.out.report.reason == planner::Reason::contact;
    if (HasFailure()) break;
  }
  RecordProperty("contact_cycles", met);
}

/// More obstacles than the planner holds are a fault of whoever sends them, reduced or not.
TEST(ExactReductions, LeaveTooManyObstaclesTooMany) {
  test::Random rng(3);
  const scene::Scene s = test::random_scene(rng, false, 0);
  for (const auto fidelity : {scene::Fidelity::full, scene::Fidelity::exact}) {
    Side side(as(s, fidelity));
    for (const std::uint32_t source : {1u, 2u}) {
      wire::ObstacleSet set;
      set.source = source;
      for (std::uint32_t id = 0; id < 2500; ++id) set.obstacles.push_back(test::sphere(id, {50, 0, 0}, 0.1));
      side.view.add(set);
    }
    side.step();
    EXPECT_EQ(side.out.report.state, planner::State::fault);
  }
}

/// One step from 10,000 states of the shipped scenes and of random ones.
TEST(ExactReductions, LeaveOneStepMapsAsTheyAre) {
  test::Random rng(5);
  double worst = 0;
  int locked = 0;
  const auto compare = [&](const scene::Scene& written, int states) {
    const auto at = scene::locked_values(written);
    const scene::Scene full = as(written, scene::Fidelity::full), exact = as(written, scene::Fidelity::exact);
    locked += full.robot.chain.n() != exact.robot.chain.n();
    dynamics::Integrator a(full.robot.chain, full.dynamics), b(exact.robot.chain, exact.dynamics);
    const int n = full.robot.chain.n();
    for (int k = 0; k < states; ++k) {
      VectorXd q = rng.vector(n, 1.5), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
      for (int i = 0; i < n; ++i)
        if (const auto& value = at[static_cast<std::size_t>(i)]) q[i] = *value, qd[i] = tau[i] = 0;
      dynamics::State x = a.start(q, qd), y = b.start(moving(q, at), moving(qd, at));
      const bool went = a.step(x, tau).usable();
      ASSERT_EQ(went, b.step(y, moving(tau, at)).usable());
      if (!went) continue;
      const VectorXd x_q = moving(x.q, at), x_p = moving(x.p, at);
      worst = std::max({worst, (x_q - y.q).norm() / (1 + y.q.norm()), (x_p - y.p).norm() / (1 + y.p.norm())});
    }
  };
  for (const char* name : {"three_link_swing", "fast_rods", "four_link_avoid", "four_link_khatib",
                           "panda_reach", "panda_person"}) {
    auto scene = files::read_scene(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes/" + name + ".textproto");
    ASSERT_TRUE(scene);
    compare(scene.value(), 2000);
  }
  for (int k = 0; k < 100; ++k) compare(test::random_scene(rng, k % 2 == 0, k % 3 == 0 ? 0.3 : 0), 20);
  EXPECT_GT(locked, 10);
  EXPECT_LT(worst, 1e-13);
  RecordProperty("worst", std::to_string(worst));
}

/// A thousand obstacles of which ten are in reach: the planner is handed those that can matter.
TEST(ExactReductions, HandThePlannerFewOfAThousand) {
  auto scene = files::read_scene(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes/panda_reach.textproto");
  ASSERT_TRUE(scene);
  scene::Scene& s = scene.value();
  test::Random rng(1);
  s.perception.obstacles.clear();
  for (std::uint32_t id = 1; id <= 1000; ++id) {
    scene::ScriptedObstacle o;
    o.at_start = test::sphere(id, {}, 0.05);
    const double far = id <= 10 ? rng.uniform(0.7, 0.9) : rng.uniform(2.5, 8);
    o.at_start.X_WO.p = Eigen::Vector3d(0, 0, 0.333) + far * rng.unit();
    s.perception.obstacles.push_back(o);
  }
  s.duration_s = 0.2;
  expect_equal(s);
  const scene::Scene exact = as(s, scene::Fidelity::exact);
  planner::ObstacleView view(exact);
  wire::ObstacleSet set;
  for (const scene::ScriptedObstacle& o : exact.perception.obstacles) set.obstacles.push_back(o.at_start);
  view.add(set);
  wire::Causes causes;
  (void)view.at(0, exact.q0, causes);
  EXPECT_LE(view.obstacles().size(), 30u) << "of " << set.obstacles.size();
}

}  // namespace
}  // namespace hamel
