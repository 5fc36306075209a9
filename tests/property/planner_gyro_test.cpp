// The gyroscopic force on an arm among obstacles that fly: it knows relative velocity alone.
#include <gtest/gtest.h>

#include "services/planner/core/gyro.h"
#include "tests/support/planner_scene.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::Mapping;
using scene::Method;

constexpr int kBase = 3, kJoints = 7;  // three of them carry the arm along x, y and z
constexpr double kPeriod_s = 1e-3;

scene::Robot on_a_carriage(test::Random& rng) {
  model::ChainSpec spec = test::random_chain(rng, kJoints, {.prismatic = 0}).spec();
  spec.gravity_W_mps2.setZero();
  for (int j = 0; j < kBase; ++j) {
    model::Joint& joint = spec.joints[static_cast<std::size_t>(j)];
    joint.kind = model::JointKind::prismatic;
    joint.X_PJ = {};
    joint.axis = Vector3d::Unit(j);
  }
  spec.X_WB0 = {};
  scene::Robot robot{"r", "", test::checked(std::move(spec)), {}};
  for (int i = kBase; i < kJoints; ++i)
    robot.shapes.push_back(test::link_capsule(i, {0, 0, 0}, {0.3, 0, 0}, 0.05));
  return robot;
}

/// The gyroscopic torque of one state, and what it was made of.
struct Turned {
  Turned(const scene::Robot& robot, const scene::PlannerOptions& options, const VectorXd& q,
         const VectorXd& qd, std::span<const geometry::Obstacle> seen, const VectorXd& wanted)
      : arm(robot.chain), pairs(robot, options), gyro(arm, options), tau(wanted) {
    arm.update(q, qd);
    Memory memory;
    obstacles.take(seen, 0, 0, options, memory);
    pairs.find(arm, obstacles);
    pairs.complete(arm);
    gyro.choose_axes(pairs, memory, 0, VectorXd::Zero(kJoints));
    gyro.add(arm, pairs, kPeriod_s, tau);
    tau -= wanted;
    v_mid = arm.M_llt.solve(VectorXd(kPeriod_s * (wanted + tau - arm.coriolis)));
    v_mid = qd + 0.5 * v_mid;
  }
  Arm arm;
  Pairs pairs;
  Obstacles obstacles;
  Gyro gyro;
  VectorXd tau, v_mid;
};

struct Law {
  Method method;
  Mapping mapping;
};
class ForLaw : public testing::TestWithParam<Law> {
 protected:
  ForLaw() {
    options.method = GetParam().method;
    options.mapping = GetParam().mapping;
    options.rho0_m = 1;
  }
  // A state, obstacles about the arm, and how they all drift.
  void draw() {
    robot = on_a_carriage(rng);
    q = rng.vector(kJoints, 1), qd = rng.vector(kJoints, 1);
    drift = rng.vec3(2);
    seen.clear();
    for (std::uint32_t i = 1; i <= 5; ++i) seen.push_back(test::sphere(i, rng.vec3(1), 0.05, rng.vec3(1)));
  }
  test::Random rng{31};
  scene::PlannerOptions options;
  scene::Robot robot = on_a_carriage(rng);
  VectorXd q, qd;
  Vector3d drift;
  std::vector<geometry::Obstacle> seen;
};

// Arm and obstacles on one carriage, whether it stands or goes.
TEST_P(ForLaw, IsTheSameForAllWhoDriftAlong) {
  int turned = 0;
  for (int k = 0; k < 300; ++k) {
    draw();
    const VectorXd wanted = rng.vector(kJoints, 10);
    const Turned here(robot, options, q, qd, seen, wanted);
    VectorXd qd_there = qd;
    qd_there.head<kBase>() += drift;
    for (geometry::Obstacle& o : seen) o.V_WO.tail<3>() += drift;
    const Turned there(robot, options, q, qd_there, seen, wanted);
    ASSERT_LE((there.tau - here.tau).norm(), 1e-8 * (1 + here.tau.norm())) << k;
    ASSERT_EQ(there.pairs.items().size(), here.pairs.items().size());
    for (std::size_t i = 0; i < here.pairs.items().size(); ++i) {
      const Vector3d a = here.pairs.items()[i].gyroscopic, b = there.pairs.items()[i].gyroscopic;
      ASSERT_LE((a - b).norm(), 1e-8 * (1 + a.norm())) << k;
      turned += a.norm() > 1e-3;
    }
  }
  EXPECT_GT(turned, 300);
}

// Over a period the torque is J^T of the forces told, and those do no work on who moves with the obstacle.
TEST_P(ForLaw, DoesNoWorkAgainstTheObstacleAndTellsWhatItApplied) {
  for (int k = 0; k < 300; ++k) {
    draw();
    const Turned t(robot, options, q, qd, seen, rng.vector(kJoints, 10));
    VectorXd sum = VectorXd::Zero(kJoints);
    double injected_W = 0;
    for (std::size_t i = 0; i < t.pairs.items().size(); ++i) {
      const Pair& pair = t.pairs.items()[i];
      const Vector3d v = t.pairs.J(i) * t.v_mid - pair.v_obstacle;
      ASSERT_LE(std::abs(pair.gyroscopic.dot(v)), 1e-9 * (1 + pair.gyroscopic.norm() * v.norm())) << k;
      sum += t.pairs.J(i).transpose() * pair.gyroscopic;
      injected_W += pair.gyroscopic.dot(pair.v_obstacle);
    }
    ASSERT_LE((sum - t.tau).norm(), 1e-8 * (1 + sum.norm())) << k;
    ASSERT_NEAR(t.gyro.injected_power_W(), injected_W, 1e-8 * (1 + std::abs(injected_W))) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, ForLaw,
                         testing::Values(Law{Method::gyro, Mapping::symmetric},
                                         Law{Method::gyro_paper, Mapping::symmetric},
                                         Law{Method::gyro_paper, Mapping::force}));

}  // namespace
}  // namespace hamel::planner
