// What keeps the arm's motion calm: circulation that does not feed on speed, limits that weigh in without a
// jump, braking that ends.
#include <gtest/gtest.h>

#include "services/planner/core/attraction.h"
#include "services/planner/core/reachable.h"
#include "tests/support/planner_scene.h"

namespace hamel::test {
namespace {

using Eigen::VectorXd;
using planner::Output;
using planner::Planner;
using planner::State;

// A planar arm whose last links stand within reach of one sphere, the goal behind it.
struct BesideASphere {
  scene::Robot robot = planar_arm(4, 1.0 / 12, 0.05);
  scene::PlannerOptions options;
  std::vector<geometry::Obstacle> obstacles{sphere(1, {1.95, 2.45, 0}, 0.25)};
  scene::Goal goal;
  VectorXd q = Eigen::Vector4d(0.2, 0.5, 0.3, 0.2);

  BesideASphere() {
    options.vmax_mps = 1;
    options.kobs = 0;
    options.barrier_gain = 0;
    goal.id = 1;
    goal.X_WG.p = {2, 3, 0};
  }
  /// Circulation's push on each link at this speed.
  std::vector<double> push_N(const VectorXd& qd) const {
    Planner p(robot, options);
    p.set_goal(goal);
    Output out = p.output();
    p.plan({.dt_s = 1e-6, .q = q, .qd = qd, .obstacles = obstacles}, out);
    std::vector<double> push;
    for (const planner::LinkReport& link : out.report.links) push.push_back(link.repulsive_N.norm());
    return push;
  }
};

// A pull that brakes what flies off presses on nothing: at no speed is the push more than half as much again
// as at rest.
TEST(Circulation, DoesNotFeedOnItsOwnSpeed) {
  const BesideASphere b;
  const std::vector<double> rest = b.push_N(VectorXd::Zero(4));
  EXPECT_GT(rest[3], 1);
  Random rng(31);
  int pushed = 0;
  for (int k = 0; k < 400; ++k) {
    const std::vector<double> push = b.push_N(rng.vector(4, 20));
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_LE(push[i], 1.5 * rest[i] * (1 + 1e-4) + 1e-4) << k;
      pushed += push[i] > 0;
    }
  }
  EXPECT_GT(pushed, 100);
}

/// An arm that stands with its joints near their limits.
planner::Arm near_its_limits(unsigned seed) {
  Random rng(seed);
  const VectorXd q = rng.vector(4, 1.5);
  model::ChainSpec spec = planar_arm(4, 1.0 / 12, 0.05).chain.spec();
  for (int j = 0; j < 4; ++j) {
    model::JointLimits& limits = spec.joints[static_cast<std::size_t>(j)].limits;
    limits.lower = q[j] - rng.uniform(0.02, 0.4);
    limits.upper = q[j] + rng.uniform(0.02, 0.4);
  }
  planner::Arm arm(checked(std::move(spec)));
  arm.update(q, VectorXd::Zero(4));
  return arm;
}

/// The largest change of the wanted acceleration as the goal goes round the tip in so many steps.
double largest_change(const planner::Arm& arm, int steps) {
  scene::PlannerOptions options;
  options.limit_weight = 100;
  options.vmax_mps = 1;
  planner::Attraction attraction(arm, options);
  VectorXd before;
  double largest = 0;
  for (int k = 0; k <= steps; ++k) {
    const double angle = 2 * M_PI * k / steps;
    scene::Goal goal;
    goal.X_WG.p = arm.X_WE.p + Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    attraction.update(arm, goal, 0, 1);
    const VectorXd qdd = attraction.drive();  // the arm stands
    if (k > 0) largest = std::max(largest, (qdd - before).norm());
    before = qdd;
  }
  return largest;
}

// A joint near its limit that turns from going into it to leaving it: the wanted acceleration has no jump
// there, so that ten times finer steps are much smaller ones.
TEST(Attraction, DoesNotJumpWhereAJointNearItsLimitTurnsBack) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
    const planner::Arm arm = near_its_limits(seed);
    EXPECT_LT(largest_change(arm, 20000), 0.35 * largest_change(arm, 2000)) << "seed " << seed;
  }
}

// One joint, whatever its strength and speed: no later than a tenth of a second, or than the torque allows.
TEST(Braking, EndsInATenthOfASecondOrInTheLeastTimeThatTorqueAllows) {
  constexpr double dt_s = 1e-3, still_radps = 0.02;
  for (const double speed : {0.05, 0.3, 1.0, 3.0})
    for (const double strongest : {2.0, 5.0, 10.0, 20.0, 50.0, 200.0, 1e6}) {  // acceleration [rad/s^2]
      scene::Robot robot = planar_arm(1, 1.0, 0.05);
      model::ChainSpec spec = robot.chain.spec();
      spec.joints[0].limits.effort = strongest * 1.25;  // of 1 + 1/4 kg m^2
      robot.chain = checked(std::move(spec));
      Planner p(robot, {});
      Output out = p.output();
      scene::DynamicsOptions o;
      o.dt_s = dt_s;
      dynamics::Integrator dynamics(robot.chain, o);
      dynamics::State s = dynamics.start(VectorXd::Zero(1), VectorXd::Constant(1, speed));
      double stopped_s = 0;
      for (int k = 0; k < 3000; ++k) {
        p.plan({.t_s = k * dt_s, .dt_s = dt_s, .q = s.q, .qd = s.qd, .obstacles = {}, .obstacle_age_s = 1},
               out);
        EXPECT_EQ(out.report.state, State::unsafe);
        ASSERT_TRUE(dynamics.step(s, out.torque_Nm).usable());
        if (std::abs(s.qd[0]) >= still_radps) stopped_s = (k + 2) * dt_s;
      }
      const double least_s = (speed - still_radps) / strongest;
      EXPECT_LE(stopped_s, std::max(0.1, least_s + 0.012)) << speed << " rad/s, " << strongest << " rad/s^2";
      EXPECT_LT(std::abs(s.qd[0]), 1e-9) << "it stands in the end";
    }
}

// Postures at the goal are found near where the search began, and meet it.
TEST(Reach, FindsAPostureAtTheGoalNearTheStart) {
  const scene::Robot robot = planar_arm(4, 1.0 / 12, 0.05);
  const scene::PlannerOptions options;
  Random rng(5);
  int found = 0;
  for (int k = 0; k < 200; ++k) {
    scene::Goal goal;
    planner::Arm arm(robot.chain);
    arm.update(rng.vector(4, 3), VectorXd::Zero(4));
    goal.X_WG.p = arm.X_WE.p;
    const VectorXd start = rng.vector(4, 15);  // turns away from where it was built
    const VectorXd q = planner::configuration_at(robot.chain, goal, options, start);
    if (q.size() == 0) continue;
    ++found;
    arm.update(q, VectorXd::Zero(4));
    EXPECT_LT((arm.X_WE.p - goal.X_WG.p).norm(), options.goal_tolerance_m);
    EXPECT_LT((q - start).lpNorm<Eigen::Infinity>(), 2 * M_PI);
  }
  EXPECT_GT(found, 100);
}

}  // namespace
}  // namespace hamel::test
