// Exact reductions leave results as they are: every shipped scene, and random ones, against full fidelity.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "clients/hamel/ticks.h"
#include "common/files/scene_text.h"
#include "common/rbd/planar_chain.h"
#include "common/scene/locked.h"
#include "common/scene/reduce.h"
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
    if (std::isfinite(x.clearance_m) || std::isfinite(y.clearance_m)) {
      EXPECT_NEAR(x.clearance_m, y.clearance_m, 100 * grown + 1e-12);
    }
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

class RandomScenes : public test::ForSeed {};
INSTANTIATE_TEST_SUITE_P(ExactReductions, RandomScenes, testing::Range(0u, 100u));

TEST_P(RandomScenes, StayAsTheyAre) {
  expect_equal(test::random_scene(rng, GetParam() % 2 == 0, GetParam() % 4 == 0 ? 0.3 : 0));
}

/// One step from 10,000 states of the shipped scenes and of random ones.
TEST(ExactReductions, LeaveOneStepMapsAsTheyAre) {
  test::Random rng(5);
  double worst = 0;
  const auto compare = [&](const scene::Scene& written, int states) {
    const scene::Scene full = as(written, scene::Fidelity::full), exact = as(written, scene::Fidelity::exact);
    if (full.robot.chain.n() != exact.robot.chain.n()) return;
    dynamics::Integrator a(full.robot.chain, full.dynamics), b(exact.robot.chain, exact.dynamics);
    const int n = full.robot.chain.n();
    for (int k = 0; k < states; ++k) {
      const VectorXd q = rng.vector(n, 1.5), qd = rng.vector(n, 1), tau = rng.vector(n, 1);
      dynamics::State x = a.start(q, qd), y = b.start(q, qd);
      const bool went = a.step(x, tau).usable();
      ASSERT_EQ(went, b.step(y, tau).usable());
      if (!went) continue;
      worst = std::max({worst, (x.q - y.q).norm() / (1 + x.q.norm()), (x.p - y.p).norm() / (1 + x.p.norm())});
    }
  };
  for (const char* name : {"three_link_swing", "fast_rods", "four_link_avoid", "panda_reach"}) {
    auto scene = files::read_scene(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes/" + name + ".textproto");
    ASSERT_TRUE(scene);
    compare(scene.value(), 2000);
  }
  for (int k = 0; k < 100; ++k) compare(test::random_scene(rng, true, 0), 20);
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
