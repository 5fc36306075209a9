// What the gyroscopic force of `gyro` does to energy over a step, and to a particle that flies straight at an
// obstacle's centre.
#include <gtest/gtest.h>

#include <algorithm>

#include "services/planner/core/gyro.h"
#include "tests/support/planner_scene.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kJoints = 7;

/// Seven joints in the midst of standing spheres, at a state of their own; the torque is the gyroscopic one
/// alone, for a step of dt.
class Turned {
 public:
  explicit Turned(test::Random& rng) : robot_(drawn(rng)), arm_(robot_.chain), pairs_(robot_, options_) {
    q_ = rng.vector(kJoints, 3), qd_ = rng.vector(kJoints, 2);
    for (std::uint32_t i = 1; i <= 5; ++i) seen_.push_back(test::sphere(i, rng.vec3(1), 0.05));
  }
  /// As the planner does: at the middle of the step.
  VectorXd torque(double dt_s) {
    arm_.update(q_ + 0.5 * dt_s * qd_, qd_);
    Memory memory;
    Obstacles obstacles;
    obstacles.take(seen_, 0, 0, options_, memory);
    pairs_.find(arm_, obstacles);
    pairs_.complete(arm_);
    Gyro gyro(arm_, options_);
    gyro.choose_axes(pairs_, memory, 0, VectorXd::Zero(kJoints));
    VectorXd tau = VectorXd::Zero(kJoints);
    gyro.add(arm_, pairs_, dt_s, tau);
    return tau;
  }
  double kinetic_J() const { return 0.5 * qd_.dot(arm_.M * qd_); }
  /// In a step of M dqd = dt (tau - c), M and c of its middle.
  double work_J(const VectorXd& tau, double dt_s) const {
    const VectorXd dqd = arm_.M_llt.solve(VectorXd(dt_s * (tau - arm_.coriolis)));
    return dt_s * tau.dot(qd_ + 0.5 * dqd);
  }
  /// In a step of the project's own midpoint integrator: tau holds, so all of it is tau . (q+ - q).
  double work_of_the_integrator_J(const VectorXd& tau, double dt_s) const {
    scene::DynamicsOptions o;
    o.dt_s = dt_s;
    dynamics::Integrator dynamics(robot_.chain, o);
    dynamics::State s = dynamics.start(q_, qd_);
    EXPECT_TRUE(dynamics.step(s, tau).usable());
    return tau.dot(s.q - q_);
  }

 private:
  static scene::Robot drawn(test::Random& rng) {
    model::ChainSpec spec = test::random_chain(rng, kJoints, {.prismatic = 0}).spec();
    spec.gravity_W_mps2.setZero();
    for (model::Joint& j : spec.joints) j.limits = {}, j.damping = 0;
    scene::Robot robot{"r", "", test::checked(std::move(spec)), {}};
    for (int i = 0; i < kJoints; ++i)
      robot.shapes.push_back(test::link_capsule(i, {0, 0, 0}, {0.3, 0, 0}, 0.05));
    return robot;
  }

  const scene::PlannerOptions options_{.method = scene::Method::gyro, .rho0_m = 1};
  scene::Robot robot_;
  Arm arm_;
  Pairs pairs_;
  VectorXd q_, qd_;
  std::vector<geometry::Obstacle> seen_;
};

TEST(GyroscopicForce, DoesNoWorkOverAStep) {
  test::Random rng(41);
  int turned = 0;
  double worst = 0;
  for (int k = 0; k < 1000; ++k) {
    Turned t(rng);
    for (const double dt_s : {1e-4, 1e-3, 1e-2}) {
      const VectorXd tau = t.torque(dt_s);
      turned += tau.norm() > 1e-3;
      worst = std::max(worst, std::abs(t.work_J(tau, dt_s)) / t.kinetic_J());
    }
  }
  EXPECT_GT(turned, 1000);
  EXPECT_LE(worst, 1e-12);
  RecordProperty("worst", std::to_string(1e15 * worst) + "e-15");
}

// The integrator's inertia is not the one of the step's middle: what is left is of third order in the step.
TEST(GyroscopicForce, DoesWorkOfThirdOrderInAStepOfTheIntegrator) {
  test::Random rng(43);
  double coarse = 0, fine = 0;
  for (int k = 0; k < 300; ++k) {
    Turned t(rng);
    const auto work = [&](double dt_s) {
      const VectorXd tau = t.torque(dt_s);
      return std::abs(t.work_of_the_integrator_J(tau, dt_s)) / t.kinetic_J();
    };
    coarse += work(1e-3) / 300;
    fine += work(5e-4) / 300;
  }
  RecordProperty("mean_of_1_ms", std::to_string(1e9 * coarse) + "e-9");
  EXPECT_GT(coarse / fine, 6);
  EXPECT_LE(coarse, 1e-6);
}

/// A ball of 1 kg that flies where it likes.
scene::Robot particle() {
  model::ChainSpec spec = test::planar(3, 1.0, 1.0, 1.0);
  spec.gravity_W_mps2.setZero();
  for (int j = 0; j < 3; ++j) {
    model::Joint& joint = spec.joints[static_cast<std::size_t>(j)];
    joint.kind = model::JointKind::prismatic;
    joint.X_PJ = {};
    joint.axis = Vector3d::Unit(j);
    const double mass_kg = j < 2 ? 1e-9 : 1;
    spec.links[static_cast<std::size_t>(j)].inertia = {mass_kg, Vector3d::Zero(),
                                                       mass_kg * Eigen::Matrix3d::Identity()};
  }
  spec.X_NE = {};
  scene::Robot robot{"particle", "", test::checked(std::move(spec)), {}};
  scene::LinkShape ball;
  ball.link = 2;
  ball.shape = {geometry::ShapeKind::sphere, {0.01, 0, 0}};
  robot.shapes.push_back(ball);
  return robot;
}

/// How it went, and the place farthest from the straight way.
struct Flight {
  test::RunResult r;
  Vector3d farthest = Vector3d::Zero();
};

Flight fly_at(double offset_m) {
  scene::PlannerOptions o{.method = scene::Method::gyro, .vmax_mps = 1};
  o.barrier_gain = 0, o.kc = 0, o.escapes = 0;
  scene::Goal goal;
  goal.id = 1;
  goal.X_WG.p = {3, 0, 0};
  Flight f;
  f.r = test::run(particle(), {test::sphere(1, {1.5, offset_m, 0}, 0.25)}, o, goal, VectorXd::Zero(3), 1e-3,
                  20, [&](const test::RunResult& now) {
                    const Vector3d& p = now.last.end_effector_m;
                    const Vector3d across(0, p.y(), p.z());
                    if (across.norm() > f.farthest.norm()) f.farthest = across;
                    return false;
                  });
  return f;
}

// The paper's turning axis is not defined there.  No barrier, no circulation: the force alone leads round, on
// a side that rounding does not choose.
TEST(GyroscopicForce, LeadsRoundWhatIsFlownAtHeadOnAlwaysOnTheSameSide) {
  for (const double offset_m : {0.0, 1e-16, 1e-12}) {
    const Flight f = fly_at(offset_m), again = fly_at(offset_m), other = fly_at(-offset_m);
    EXPECT_EQ(f.r.last.state, State::reached) << offset_m;
    EXPECT_EQ(f.r.contact_at_s, -1) << offset_m;
    EXPECT_GT(f.r.clearance_min_m, 0) << offset_m;
    EXPECT_EQ(f.farthest, again.farthest) << offset_m;
    EXPECT_NEAR((f.farthest - other.farthest).norm(), 0, 1e-6) << offset_m;
    EXPECT_GT(f.farthest.norm(), 0.25) << offset_m;
  }
}

}  // namespace
}  // namespace hamel::planner
