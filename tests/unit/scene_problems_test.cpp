// Every rule of scene::problems(): a valid scene, one thing wrong at a time, and the problem that names it.
#include <gtest/gtest.h>

#include <functional>

#include "common/scene/scene.h"

namespace hamel::scene {
namespace {

model::ChainSpec planar_spec(int n) {
  model::ChainSpec spec;
  for (int i = 0; i < n; ++i) {
    const std::string number = std::to_string(i + 1);
    model::Joint joint;
    joint.name = std::string("joint").append(number);
    joint.kind = model::JointKind::continuous;
    if (i > 0) joint.X_PJ.p.x() = 1;
    spec.joints.push_back(joint);
    spec.links.push_back({std::string("link").append(number), {1, {0.5, 0, 0}, Eigen::Matrix3d::Identity()}});
  }
  spec.joints[0].limits.lower = -1;
  spec.joints[0].limits.upper = 1;
  return spec;
}

ScriptedObstacle sphere(std::uint32_t id) {
  ScriptedObstacle o;
  o.at_start.id = id;
  o.at_start.shape.dims_m[0] = 0.1;
  return o;
}

Scene valid() {
  Robot robot{"arm", "", model::build(planar_spec(2)).value(), {}, {}};
  robot.shapes.push_back({0, {geometry::ShapeKind::capsule, {0.1, 1, 0}}, {}});
  Scene s{"test", "", 1,  robot, Eigen::VectorXd::Zero(2), Eigen::VectorXd::Zero(2), Goal{}, true, {},
          {},     {}, {}, 10,    StopRule::when_reached};
  s.goal->id = 1;
  s.perception.obstacles = {sphere(1), sphere(2)};
  s.perception.stream.emplace().samples = {{0, 7, {0, 0, 0}, {geometry::ShapeKind::sphere, {0.1, 0, 0}}}};
  return s;
}

struct Case {
  const char* path;
  const char* rule;  // part of the text
  std::function<void(Scene&)> breaks;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.path << " " << c.rule; }

class Rule : public testing::TestWithParam<Case> {};

TEST(SceneProblems, NoneInAValidScene) {
  for (const Problem& p : problems(valid())) ADD_FAILURE() << to_string(p);
}

TEST_P(Rule, IsNamedWhenBroken) {
  Scene s = valid();
  GetParam().breaks(s);
  const Problems found = problems(s);
  for (const Problem& p : found)
    if (p.where == GetParam().path && p.what.find(GetParam().rule) != std::string::npos) return;
  for (const Problem& p : found) ADD_FAILURE() << "instead: " << to_string(p);
  FAIL() << "no problem at " << GetParam().path;
}

const double kNan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Dynamics, Rule,
    testing::Values(Case{"dynamics.dt_s", "= -1, must be > 0", [](Scene& s) { s.dynamics.dt_s = -1; }},
                    Case{"dynamics.dt_s", "= nan", [](Scene& s) { s.dynamics.dt_s = kNan; }},
                    Case{"dynamics.dt_s", "= inf", [](Scene& s) { s.dynamics.dt_s = kInf; }},
                    Case{"dynamics.alpha", "in [0, 1]", [](Scene& s) { s.dynamics.alpha = 1.5; }},
                    Case{"dynamics.stages", "in [1, 8]", [](Scene& s) { s.dynamics.stages = 9; }},
                    Case{"dynamics.tolerance_Nm", ">= 0", [](Scene& s) { s.dynamics.tolerance_Nm = -1; }},
                    Case{"dynamics.tolerance_rel", "> 0", [](Scene& s) { s.dynamics.tolerance_rel = 0; }},
                    Case{"dynamics.max_iterations", ">= 1", [](Scene& s) { s.dynamics.max_iterations = 0; }},
                    Case{"dynamics.max_subdivisions", "in [0, 20]",
                         [](Scene& s) { s.dynamics.max_subdivisions = 21; }},
                    Case{"dynamics.stop_stiffness", ">= 0", [](Scene& s) { s.dynamics.stop_stiffness = -1; }},
                    Case{"dynamics.bus", "\"ros\"", [](Scene& s) { s.bus.dynamics = std::string("ros"); }}));

INSTANTIATE_TEST_SUITE_P(
    Planner, Rule,
    testing::Values(
        Case{"planner.period_steps", ">= 1", [](Scene& s) { s.planner.period_steps = 0; }},
        Case{"planner.kp", "> 0", [](Scene& s) { s.planner.kp = 0; }},
        Case{"planner.kv", "> 0", [](Scene& s) { s.planner.kv = kNan; }},
        Case{"planner.vmax_mps", "> 0", [](Scene& s) { s.planner.vmax_mps = 0; }},
        Case{"planner.angular_vmax_radps", "> 0", [](Scene& s) { s.planner.angular_vmax_radps = 0; }},
        Case{"planner.stale_state_s", "> 0", [](Scene& s) { s.planner.stale_state_s = 0; }},
        Case{"planner.brake_rate", "> 0", [](Scene& s) { s.planner.brake_rate = 0; }},
        Case{"planner.amax", "> 0", [](Scene& s) { s.planner.amax = -1; }},
        Case{"planner.damping", ">= 0", [](Scene& s) { s.planner.damping = -1; }},
        Case{"planner.eta", ">= 0", [](Scene& s) { s.planner.eta = -1; }},
        Case{"planner.rho0_m", "> 0", [](Scene& s) { s.planner.rho0_m = 0; }},
        Case{"planner.kobs", ">= 0", [](Scene& s) { s.planner.kobs = -1; }},
        Case{"planner.phi_min_rad", "> 0", [](Scene& s) { s.planner.phi_min_rad = 0; }},
        Case{"planner.c0", "in (0, 1]", [](Scene& s) { s.planner.c0 = 0; }},
        Case{"planner.lambda2", "> 0", [](Scene& s) { s.planner.lambda2 = 0; }},
        Case{"planner.dmin_m", ">= 0", [](Scene& s) { s.planner.dmin_m = -1; }},
        Case{"planner.dmin_m", "< rho0_m",
             [](Scene& s) { s.planner.barrier_gain = 10, s.planner.dmin_m = 1; }},
        Case{"planner.barrier_gain", ">= 0", [](Scene& s) { s.planner.barrier_gain = -1; }},
        Case{"planner.kc", "0 or >= 1", [](Scene& s) { s.planner.kc = 0.5; }},
        Case{"planner.kc", "> 1 on a planar arm", [](Scene& s) { s.planner.kc = 1; }},
        Case{"planner.flip_time_s", "> 0", [](Scene& s) { s.planner.flip_time_s = 0; }},
        Case{"planner.limit_weight", ">= 0", [](Scene& s) { s.planner.limit_weight = -1; }},
        Case{"planner.progress_window_s", "> 0", [](Scene& s) { s.planner.progress_window_s = 0; }},
        Case{"planner.goal_tolerance_m", "> 0", [](Scene& s) { s.planner.goal_tolerance_m = 0; }},
        Case{"planner.goal_tolerance_rad", "> 0", [](Scene& s) { s.planner.goal_tolerance_rad = 0; }},
        Case{"planner.goal_tolerance_joint", "> 0", [](Scene& s) { s.planner.goal_tolerance_joint = 0; }},
        Case{"planner.goal_speed", "> 0", [](Scene& s) { s.planner.goal_speed = 0; }},
        Case{"planner.goal_hold_s", ">= 0", [](Scene& s) { s.planner.goal_hold_s = -1; }},
        Case{"planner.stale_brake_s", "> 0", [](Scene& s) { s.planner.stale_brake_s = 0; }},
        Case{"planner.stale_slow_s", "> 0", [](Scene& s) { s.planner.stale_slow_s = 0; }},
        Case{"planner.stale_slow_s", "<= stale_brake_s", [](Scene& s) { s.planner.stale_slow_s = 1; }},
        Case{"planner.escapes", ">= 0", [](Scene& s) { s.planner.escapes = -1; }},
        Case{"planner.escape_rollouts", ">= 1", [](Scene& s) { s.planner.escape_rollouts = 0; }},
        Case{"planner.escape_horizon_s", "> 0", [](Scene& s) { s.planner.escape_horizon_s = 0; }},
        Case{"planner.escape_delay_s", ">= 0", [](Scene& s) { s.planner.escape_delay_s = -1; }},
        Case{"planner.assumed_speed_mps", ">= 0", [](Scene& s) { s.planner.assumed_speed_mps = -1; }},
        Case{"planner.ramp_s", ">= 0", [](Scene& s) { s.planner.ramp_s = -1; }},
        Case{"planner.bus", "must be inproc", [](Scene& s) { s.bus.planner = std::string("x"); }}));

INSTANTIATE_TEST_SUITE_P(
    Perception, Rule,
    testing::Values(
        Case{"perception.rate_hz", "> 0", [](Scene& s) { s.perception.rate_hz = 0; }},
        Case{"perception.bus", "must be inproc", [](Scene& s) { s.bus.perception = std::string("x"); }},
        Case{"perception.obstacles[1].id", "is used twice",
             [](Scene& s) { s.perception.obstacles[1].at_start.id = 1; }},
        Case{"perception.obstacles[0].id", "also an id of the stream",
             [](Scene& s) { s.perception.obstacles[0].at_start.id = 7; }},
        Case{"perception.obstacles[0].sphere.radius_m", ">= 0",
             [](Scene& s) { s.perception.obstacles[0].at_start.shape.dims_m[0] = -1; }},
        Case{"perception.obstacles[0].capsule.length_m", ">= 0",
             [](Scene& s) {
               s.perception.obstacles[0].at_start.shape = {geometry::ShapeKind::capsule, {1, -1, 0}};
             }},
        Case{"perception.obstacles[0].cylinder.radius_m", "> 0",
             [](Scene& s) {
               s.perception.obstacles[0].at_start.shape = {geometry::ShapeKind::cylinder, {0, 1, 0}};
             }},
        Case{"perception.obstacles[0].box.size_m", "three edges > 0",
             [](Scene& s) {
               s.perception.obstacles[0].at_start.shape = {geometry::ShapeKind::box, {1, 1, 0}};
             }},
        Case{"perception.obstacles[0].position_m", "not finite",
             [](Scene& s) { s.perception.obstacles[0].at_start.X_WO.p.x() = kNan; }},
        Case{"perception.obstacles[0].rpy_rad", "not a rotation",
             [](Scene& s) { s.perception.obstacles[0].at_start.X_WO.R *= 2; }},
        Case{"perception.obstacles[0].sigma_m", ">= 0",
             [](Scene& s) { s.perception.obstacles[0].at_start.sigma_m = -1; }},
        Case{"perception.obstacles[0].velocity_mps", "not finite",
             [](Scene& s) { s.perception.obstacles[0].velocity_mps.x() = kInf; }},
        Case{"perception.obstacles[0].sinusoid.amplitude_m", "not finite",
             [](Scene& s) { s.perception.obstacles[0].amplitude_m.x() = kInf; }},
        Case{"perception.obstacles[0].sinusoid.frequency_hz", ">= 0",
             [](Scene& s) { s.perception.obstacles[0].frequency_hz = -1; }},
        Case{"perception.obstacles[0].sinusoid.frequency_hz", "> 0 where amplitude_m",
             [](Scene& s) { s.perception.obstacles[0].amplitude_m.x() = 1; }},
        Case{"perception.obstacles[0].sinusoid.phase_rad", "not finite",
             [](Scene& s) { s.perception.obstacles[0].phase_rad = kNan; }},
        Case{"perception.obstacles[0].sinusoid", "must be one motion",
             [](Scene& s) {
               s.perception.obstacles[0].amplitude_m.x() = s.perception.obstacles[0].velocity_mps.x() = 1;
             }},
        Case{"perception.obstacles", "at most 4096", [](Scene& s) { s.perception.obstacles.resize(4097); }},
        Case{"perception.stream.scale", "> 0", [](Scene& s) { s.perception.stream->scale = 0; }},
        Case{"perception.stream.rate", "> 0", [](Scene& s) { s.perception.stream->rate = -1; }},
        Case{"perception.stream.start_s", "not finite",
             [](Scene& s) { s.perception.stream->start_s = kNan; }},
        Case{"perception.stream.start_s", "<= the time of the last sample",
             [](Scene& s) { s.perception.stream->start_s = 1; }},
        Case{"perception.stream.path", "no samples", [](Scene& s) { s.perception.stream->samples.clear(); }},
        Case{"perception.stream.position_m", "not finite",
             [](Scene& s) { s.perception.stream->X_WS.p.x() = kNan; }}));

INSTANTIATE_TEST_SUITE_P(
    Whole, Rule,
    testing::Values(
        Case{"arm", "in [1, 268435455]", [](Scene& s) { s.arm = 0; }},
        Case{"duration_s", "> 0", [](Scene& s) { s.duration_s = 0; }},
        Case{"duration_s", "= inf", [](Scene& s) { s.duration_s = kInf; }},
        Case{"q0", "each of the 2 joints", [](Scene& s) { s.q0 = Eigen::VectorXd::Zero(3); }},
        Case{"q0[1]", "not finite", [](Scene& s) { s.q0[1] = kNan; }},
        Case{"q0[0]", "limits of joint joint1, [-1, 1]", [](Scene& s) { s.q0[0] = 2; }},
        Case{"qd0", "has 0 values", [](Scene& s) { s.qd0.resize(0); }},
        Case{"goal", "steered is false", [](Scene& s) { s.steered = false; }},
        Case{"goal.id", ">= 1", [](Scene& s) { s.goal->id = 0; }},
        Case{"goal.position_m", "not finite", [](Scene& s) { s.goal->X_WG.p.x() = kNan; }},
        Case{"goal.rpy_rad", "not a rotation", [](Scene& s) { s.goal->X_WG.R.setZero(); }},
        Case{"goal.velocity_mps", "not finite", [](Scene& s) { s.goal->V_WG[5] = kNan; }},
        Case{"goal.joints", "has 0 values", [](Scene& s) { s.goal->kind = GoalKind::joints; }},
        Case{"goal.joints[0]", "limits of joint joint1",
             [](Scene& s) { s.goal->kind = GoalKind::joints, s.goal->joints = Eigen::Vector2d(5, 0); }},
        Case{"robot.shapes[0].link", "no such link", [](Scene& s) { s.robot.shapes[0].link = 2; }},
        Case{"robot.shapes[0].capsule.radius_m", ">= 0",
             [](Scene& s) { s.robot.shapes[0].shape.dims_m[0] = -1; }}));

TEST(SceneProblems, AreAllListedAtOnce) {
  Scene s = valid();
  s.dynamics.dt_s = s.planner.kp = s.duration_s = -1;
  s.q0[0] = 9;
  s.perception.rate_hz = 0;
  EXPECT_EQ(problems(s).size(), 5u);
}

TEST(SceneWarnings, SpeakOfABarrierThatComesTooLate) {
  Scene s = valid();
  s.planner.barrier_gain = 10;
  s.planner.vmax_mps = 4;
  s.planner.rho0_m = 0.5;
  EXPECT_TRUE(warnings(s).empty());
  s.perception.obstacles[0].velocity_mps.x() = 2;
  ASSERT_EQ(warnings(s).size(), 1u);
  EXPECT_NE(warnings(s)[0].find("closing speed"), std::string::npos);
}

TEST(SceneWarnings, SpeakOfWhatGoesTooFarWithinAPeriod) {
  Scene s = valid();
  s.planner.vmax_mps = 4;
  s.planner.dmin_m = 0.01;
  s.dynamics.dt_s = 1e-3;
  EXPECT_TRUE(warnings(s).empty());
  s.planner.period_steps = 2;
  ASSERT_EQ(warnings(s).size(), 1u);
  EXPECT_NE(warnings(s)[0].find("= 0.008 m"), std::string::npos) << warnings(s)[0];
  s.planner.method = Method::gyro_paper;
  s.planner.gain_form = GainForm::F2;
  s.planner.mapping = Mapping::paper;
  s.planner.kobs = 1;
  EXPECT_TRUE(warnings(s).empty());
  s.planner.kobs = 16;
  ASSERT_EQ(warnings(s).size(), 1u);
  EXPECT_NE(warnings(s)[0].find("overshoots"), std::string::npos);
}

TEST(SceneNames, AreThoseOfTheTextFormat) {
  EXPECT_STREQ(to_string(Tier::semi_implicit_euler), "semi_implicit_euler");
  EXPECT_STREQ(to_string(Method::gyro_paper), "gyro_paper");
  EXPECT_STREQ(to_string(GainForm::S), "S");
  EXPECT_STREQ(to_string(Mapping::symmetric), "symmetric");
  EXPECT_STREQ(to_string(PairPolicy::nearest), "nearest");
  EXPECT_STREQ(to_string(StopRule::at_duration), "at_duration");
  EXPECT_STREQ(to_string(Pace::realtime), "realtime");
  EXPECT_STREQ(to_string(GoalKind::pose), "pose");
}

}  // namespace
}  // namespace hamel::scene
