// What a scene does not require is left out, and nothing that it does: locked joints, gravity, obstacles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "common/scene/locked.h"
#include "common/scene/reach.h"
#include "common/scene/reduce.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/reduce_scene.h"

namespace hamel::scene {
namespace {

using Eigen::VectorXd;
using test::find;

bool holds(const std::vector<geometry::Obstacle>& set, std::uint32_t id) {
  return std::any_of(set.begin(), set.end(), [&](const geometry::Obstacle& o) { return o.id == id; });
}

class Reduced : public test::ForSeed {};
INSTANTIATE_TEST_SUITE_P(Scene, Reduced, testing::Range(0u, 60u));

/// The torques that move the arm as written, its locked joints at rest, move the smaller one the same.
TEST_P(Reduced, FrozenJointsLeaveTheOthersTheirTorques) {
  const Scene whole = test::random_scene(rng, GetParam() % 2 == 0, 0.5);
  Scene small = whole;
  const auto at = locked_values(whole);
  freeze(small, at);
  const int n = whole.robot.chain.n(), m = small.robot.chain.n();
  VectorXd q = whole.q0, qd = rng.vector(n, 2), qdd = rng.vector(n, 5), tau(n), t(m), v(m), a(m), x(m);
  for (int i = 0, k = 0; i < n; ++i) {
    const auto& value = at[static_cast<std::size_t>(i)];
    if (value) q[i] = *value, qd[i] = qdd[i] = 0;
    if (!value) x[k] = q[i], v[k] = qd[i], a[k++] = qdd[i];
  }
  rbd::Workspace big(whole.robot.chain), little(small.robot.chain);
  rbd::inverse_dynamics(whole.robot.chain, q, qd, qdd, big, tau);
  rbd::inverse_dynamics(small.robot.chain, x, v, a, little, t);
  for (int i = 0, k = 0; i < n; ++i)
    if (!at[static_cast<std::size_t>(i)]) {
      EXPECT_NEAR(t[k++], tau[i], 1e-12 * (1 + tau.norm()));
    }
  rbd::positions(whole.robot.chain, q, big);
  rbd::positions(small.robot.chain, x, little);
  const lie::Pose e = rbd::tip(whole.robot.chain, big), f = rbd::tip(small.robot.chain, little);
  EXPECT_LT((e.p - f.p).norm() + (e.R - f.R).norm(), 1e-12);
  for (std::size_t k = 0; k < whole.robot.shapes.size(); ++k) {
    const LinkShape &b = whole.robot.shapes[k], &c = small.robot.shapes[k];
    const lie::Pose X_WS = big.X_WB[static_cast<std::size_t>(b.link)] * b.X_LS;
    const lie::Pose& X_WC =
        c.link < 0 ? small.robot.chain.X_WB0() : little.X_WB[static_cast<std::size_t>(c.link)];
    EXPECT_LT((X_WS.p - (X_WC * c.X_LS).p).norm(), 1e-12);
  }
}

TEST_P(Reduced, HeldJointsStayAndTheOthersMoveAsWithoutThem) {
  Scene held = test::random_scene(rng, true, 0.5);
  held.reduce.locked = Choice::off;
  Scene frozen = held;
  frozen.reduce.locked = Choice::on;
  const auto at = locked_values(held);
  reduce(held);
  reduce(frozen);
  dynamics::Integrator a(held.robot.chain, held.dynamics), b(frozen.robot.chain, frozen.dynamics);
  dynamics::State x = a.start(held.q0, held.qd0), y = b.start(frozen.q0, frozen.qd0);
  const VectorXd none = VectorXd::Zero(x.q.size()), tau = VectorXd::Zero(y.q.size());
  for (int k = 0; k < 50; ++k) {
    ASSERT_TRUE(a.step(x, none).usable());
    ASSERT_TRUE(b.step(y, tau).usable());
  }
  for (Eigen::Index i = 0, k = 0; i < x.q.size(); ++i) {
    if (at[static_cast<std::size_t>(i)]) {
      EXPECT_EQ(x.q[i], held.q0[i]);
    } else {
      EXPECT_NEAR(x.q[i], y.q[k++], 1e-11);
    }
  }
}

TEST(Locks, AreRefusedWhereTheyContradictTheScene) {
  Scene s = [] {
    test::Random rng(3);
    return test::random_scene(rng, false, 0);
  }();
  const auto says = [&](const std::string& where) {
    const Problems all = lock_problems(s);
    return std::any_of(all.begin(), all.end(), [&](const Problem& p) { return p.where == where; });
  };
  s.locked = {{"j9", 0.0}};
  EXPECT_TRUE(says("locked[0].joint"));
  s.locked = {{"j1", {}}, {"j1", {}}};
  EXPECT_TRUE(says("locked[1].joint"));
  s.q0[1] = 0.25;
  s.locked = {{"j1", 0.5}};
  EXPECT_TRUE(says("q0[1]"));
  s.locked = {{"j1", 0.25}};
  EXPECT_TRUE(lock_problems(s).empty());
  s.qd0[1] = 1;
  EXPECT_TRUE(says("qd0[1]"));
  s.locked.clear();
  for (int i = 0; i < s.robot.chain.n(); ++i) s.locked.push_back({s.robot.chain.joint(i).name, {}});
  EXPECT_TRUE(says("locked"));
}

TEST_P(Reduced, GravityIsDroppedOnlyWhereItAsksForNoTorque) {
  Scene s = test::random_scene(rng, true, 0);
  const model::Chain before = s.robot.chain;
  reduce(s);
  rbd::Workspace ws(before);
  double asked = 0;
  VectorXd tau(before.n());
  for (int k = 0; k < 20; ++k) {
    rbd::positions(before, rng.vector(before.n(), 3), ws);
    rbd::gravity_torque(before, ws, tau);
    asked = std::max(asked, tau.lpNorm<Eigen::Infinity>());
  }
  EXPECT_EQ(s.robot.chain.gravity_W_mps2().isZero(0), asked < 1e-10);
  EXPECT_EQ(find(s, "gravity").in_force, asked < 1e-10);
}

/// Slides alone, in any directions across the weight; then one of them slightly along it.
TEST_P(Reduced, GravityOfAGantryIsDroppedWhereNoSlideGoesUp) {
  Scene s = test::random_scene(rng, false, 0);
  model::ChainSpec spec = s.robot.chain.spec();
  lie::Pose X_WB = spec.X_WB0;
  for (model::Joint& joint : spec.joints) {
    joint.kind = model::JointKind::prismatic;
    X_WB = X_WB * joint.X_PJ;
    joint.axis = X_WB.R.transpose() * spec.gravity_W_mps2.cross(rng.unit()).normalized();
  }
  Scene tilted = s;
  s.robot.chain = test::checked(spec);
  model::Joint& last = spec.joints.back();
  last.axis = (last.axis + 1e-6 * (X_WB.R.transpose() * spec.gravity_W_mps2.normalized())).normalized();
  tilted.robot.chain = test::checked(spec);
  reduce(s), reduce(tilted);
  EXPECT_TRUE(find(s, "gravity").in_force) << find(s, "gravity").why;
  EXPECT_TRUE(s.robot.chain.gravity_W_mps2().isZero(0));
  EXPECT_FALSE(find(tilted, "gravity").in_force);
}

TEST_P(Reduced, ReachBallsHoldEveryConfiguration) {
  const Scene s = test::random_scene(rng, GetParam() % 3 == 0, 0);
  const Reach reach(s.robot, s.planner);
  const model::Chain& chain = s.robot.chain;
  rbd::Workspace ws(chain);
  for (int k = 0; k < 200; ++k) {
    VectorXd q = rng.vector(chain.n(), 4);
    for (int i = 0; i < chain.n(); ++i)
      if (chain.joint(i).kind == model::JointKind::prismatic) q[i] *= 0.15;
    ASSERT_TRUE(reach.holds(q));
    rbd::positions(chain, q, ws);
    for (std::size_t b = 0; b < reach.balls().size(); ++b) {
      const ReachBall& ball = reach.balls()[b];
      const LinkShape& shape = s.robot.shapes[b];
      const geometry::Capsule c = (ws.X_WB[static_cast<std::size_t>(shape.link)] * shape.X_LS) *
                                  geometry::enclosing_capsule(shape.shape);
      EXPECT_LE((c.p0 - ball.centre_W).norm(), ball.axis_m + 1e-12);
      EXPECT_LE((c.p1 - ball.centre_W).norm(), ball.axis_m + 1e-12);
    }
  }
}

/// However the joints go, no point of a link's solid goes farther than its levers say; some nearly as far.
TEST_P(Reduced, NoPointOfALinkGoesFartherThanItsLevers) {
  Scene s = test::random_scene(rng, false, 0);
  s.robot.shapes.clear();
  test::clothe(s.robot, rng);
  const Eigen::MatrixXd lever_m = levers(s.robot);
  const model::Chain& chain = s.robot.chain;
  rbd::Workspace before(chain), after(chain);
  double closest = 0;
  for (int k = 0; k < 50; ++k) {
    VectorXd q = rng.vector(chain.n(), 0.5), to = q;
    to[k % chain.n()] += rng.uniform(-0.05, 0.05);
    if (k % 2 == 0) to += rng.vector(chain.n(), 0.02);
    rbd::positions(chain, q, before);
    rbd::positions(chain, to, after);
    for (const LinkShape& shape : s.robot.shapes) {
      if (shape.link < 0) continue;
      const auto link = static_cast<std::size_t>(shape.link);
      const double most = lever_m.col(shape.link).dot((to - q).cwiseAbs());
      const Eigen::Vector3d d = shape.shape.dims_m;
      const bool box = shape.shape.kind == geometry::ShapeKind::box;
      const Eigen::Vector3d corner = box ? Eigen::Vector3d(0.5 * d) : Eigen::Vector3d(d[0], 0, 0.5 * d[1]);
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3d sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        const Eigen::Vector3d p = shape.X_LS * Eigen::Vector3d(sign.cwiseProduct(corner));
        const double way = (after.X_WB[link] * p - before.X_WB[link] * p).norm();
        EXPECT_LE(way, most + 1e-12);
        if (most > 0) closest = std::max(closest, way / most);
      }
    }
  }
  EXPECT_GT(closest, 0.3);
}

/// No obstacle that was left out is in range of a link, or the nearest to one; no link is nearer than its
/// floor.
TEST_P(Reduced, WhatIsCulledNeverMatters) {
  const Scene s = test::random_scene(rng, GetParam() % 3 == 0, 0);
  std::vector<geometry::Obstacle> set, kept;
  for (const ScriptedObstacle& o : s.perception.obstacles) {
    set.push_back(o.at_start);
    set.back().V_WO.tail<3>() = o.velocity_mps;
  }
  std::vector<double> floor_m;
  const double horizon_s = 0.5;
  Reach reach(s.robot, s.planner);
  reach.sift(set, horizon_s, kept, floor_m);
  rbd::Workspace ws(s.robot.chain);
  for (int k = 0; k < 100; ++k) {
    VectorXd q = rng.vector(s.robot.chain.n(), 4);
    for (int i = 0; i < q.size(); ++i)
      if (s.robot.chain.joint(i).kind == model::JointKind::prismatic) q[i] *= 0.15;
    rbd::positions(s.robot.chain, q, ws);
    const double age_s = rng.uniform(0, horizon_s);
    std::vector<double> nearest_kept(floor_m.size(), kInf), nearest_culled(floor_m.size(), kInf);
    for (const LinkShape& shape : s.robot.shapes) {
      const auto link = static_cast<std::size_t>(shape.link);
      const geometry::Capsule c = (ws.X_WB[link] * shape.X_LS) * geometry::enclosing_capsule(shape.shape);
      for (geometry::Obstacle o : set) {
        double& nearest = (holds(kept, o.id) ? nearest_kept : nearest_culled)[link];
        o.X_WO.p += age_s * o.V_WO.tail<3>();
        const double d = geometry::closest(c, o.shape, o.X_WO).distance_m;
        nearest = std::min(nearest, d);
        EXPECT_GE(d - 2 * o.sigma_m, floor_m[link] - 1e-12);
      }
    }
    for (std::size_t link = 0; link < floor_m.size(); ++link) {
      EXPECT_GT(nearest_culled[link], s.planner.rho0_m);
      EXPECT_GE(nearest_culled[link], nearest_kept[link]);
    }
  }
}

/// What is dropped near a configuration is out of range and not the nearest while the arm stays near it.
TEST_P(Reduced, WhatIsDroppedNearAConfigurationDoesNotMatterThere) {
  const Scene s = test::random_scene(rng, GetParam() % 3 == 0, 0);
  std::vector<geometry::Obstacle> set, kept;
  for (const ScriptedObstacle& o : s.perception.obstacles) set.push_back(o.at_start);
  Reach reach(s.robot, s.planner);
  rbd::Workspace ws(s.robot.chain);
  const int n = s.robot.chain.n();
  for (int k = 0; k < 20; ++k) {
    const VectorXd q = rng.vector(n, 0.5);
    reach.sift_near(q, set, kept);
    for (int i = 0; i < 10; ++i) {
      const VectorXd now = q + rng.vector(n, 0.1);
      if (!reach.stays_near(now)) continue;
      rbd::positions(s.robot.chain, now, ws);
      std::vector<double> nearest_kept(static_cast<std::size_t>(n), kInf), nearest_culled = nearest_kept;
      for (const LinkShape& shape : s.robot.shapes) {
        const auto link = static_cast<std::size_t>(shape.link);
        const geometry::Capsule c = (ws.X_WB[link] * shape.X_LS) * geometry::enclosing_capsule(shape.shape);
        for (const auto& o : set) {
          const bool in = holds(kept, o.id);
          const double d = geometry::closest(c, o.shape, o.X_WO).distance_m;
          double& nearest = (in ? nearest_kept : nearest_culled)[link];
          nearest = std::min(nearest, d);
          if (!in) {
            EXPECT_GT(d, s.planner.rho0_m + 2 * o.sigma_m);
          }
        }
      }
      for (std::size_t link = 0; link < nearest_kept.size(); ++link)
        EXPECT_GE(nearest_culled[link], nearest_kept[link]);
    }
  }
}

/// 1,000 swinging obstacles: carried on from each set they stay within the bound, which is not idle either; a
/// bound of half of it would be caught.
TEST(Rate, KeepsCarriedObstaclesWithinItsBound) {
  test::Random rng(7);
  std::vector<double> ratios;
  int broken = 0;
  for (int k = 0; k < 1000; ++k) {
    ScriptedObstacle o;
    o.amplitude_m = rng.vec3(0.5);
    o.frequency_hz = rng.uniform(0.05, 3);
    o.phase_rad = rng.uniform(-3, 3);
    Scene s = test::random_scene(rng, true, 0);
    s.perception.obstacles = {o};
    s.perception.rate_hz = 10000;
    s.accuracy.obstacle_error_m = std::pow(10, rng.uniform(-4, -2));
    s.reduce.fidelity = Fidelity::fastest;
    reduce(s);
    const Reduction& r = find(s, "rate");
    ASSERT_TRUE(r.in_force);
    const double T = 1 / s.perception.rate_hz, w = 2 * M_PI * o.frequency_hz;
    const auto at = [&](double t) { return std::sin(w * t + o.phase_rad); };
    double worst = 0;
    for (double t = 0; t < 1 / o.frequency_hz; t += T)
      worst = std::max(worst, std::abs(at(t + T) - at(t) - T * w * std::cos(w * t + o.phase_rad)));
    worst *= o.amplitude_m.norm();
    EXPECT_LE(worst, r.bound * (1 + 1e-9));
    EXPECT_LE(r.bound, s.accuracy.obstacle_error_m * (1 + 1e-9));
    ratios.push_back(r.bound / worst);
    broken += worst > 0.5 * r.bound;
  }
  std::nth_element(ratios.begin(), ratios.begin() + 500, ratios.end());
  EXPECT_LT(ratios[500], 10);
  EXPECT_GT(broken, 0) << "half the bound is no bound";
}

/// Of the base only what moves matters; what locked joints made part of it keeps its nearest obstacle.
TEST(Obstacles, NearestToWhatIsLockedOntoTheBaseStay) {
  test::Random rng(11);
  Scene s = test::random_scene(rng, false, 0);
  const lie::Pose& X_WB0 = s.robot.chain.X_WB0();
  s.robot.shapes.push_back(
      {-1, {geometry::ShapeKind::sphere, {0.05, 0, 0}}, {Eigen::Matrix3d::Identity(), {20, 0, 0}}});
  std::vector<geometry::Obstacle> set{test::sphere(1, X_WB0 * Eigen::Vector3d(20, 0.5, 0), 0.05)}, kept;
  for (std::uint32_t id = 2; id <= 20; ++id)
    set.push_back(test::sphere(id, X_WB0.p + rng.uniform(0.5, 1) * rng.unit(), 0.05));
  std::vector<double> floor_m;
  for (const bool was_link : {false, true}) {
    s.robot.shapes.back().was_link = was_link;
    Reach reach(s.robot, s.planner);
    reach.sift(set, 0, kept, floor_m);
    EXPECT_EQ(holds(kept, 1), was_link);
    EXPECT_EQ(floor_m.size(), static_cast<std::size_t>(s.robot.chain.n()));
    reach.sift_near(s.q0, set, kept);
    EXPECT_EQ(holds(kept, 1), was_link);
  }
}

}  // namespace
}  // namespace hamel::scene
