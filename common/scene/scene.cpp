#include "common/scene/scene.h"

#include <cmath>
#include <numbers>
#include <set>

#include "common/base/hash.h"
#include "common/scene/locked.h"
#include "common/scene/rules.h"

namespace hamel::scene {
namespace {

constexpr std::uint32_t kMaxArm = 0x0fffffff;  // a service's instance on the wire is arm * 16 + kind
constexpr std::size_t kMaxObstacles = 4096;    // of one set on the wire
constexpr double kUnit = 1e-9;                 // how far a rotation may be from orthonormal

std::string at(const std::string& name, std::size_t i) { return name + "[" + std::to_string(i) + "]"; }

bool is_rotation(const Eigen::Matrix3d& R) {
  return R.allFinite() && (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kUnit &&
         R.determinant() > 0;
}

void check_pose(Rules& r, const std::string& name, const lie::Pose& X) {
  if (!X.p.allFinite()) r.fail(name + "position_m", "has a number that is not finite");
  if (!is_rotation(X.R)) r.fail(name + "rpy_rad", "is not a rotation");
}

void check_shape(Rules& r, const std::string& name, const geometry::Shape& shape) {
  using geometry::ShapeKind;
  const Eigen::Vector3d& d = shape.dims_m;
  switch (shape.kind) {
    case ShapeKind::sphere:
      r.not_negative(name + "sphere.radius_m", d[0]);
      break;
    case ShapeKind::capsule:
      r.not_negative(name + "capsule.radius_m", d[0]);
      r.not_negative(name + "capsule.length_m", d[1]);
      break;
    case ShapeKind::cylinder:
      r.positive(name + "cylinder.radius_m", d[0]);
      r.positive(name + "cylinder.length_m", d[1]);
      break;
    case ShapeKind::box:
      if (!d.allFinite() || !(d.array() > 0).all()) r.fail(name + "box.size_m", "must have three edges > 0");
      break;
    case ShapeKind::half_space:
      break;
  }
}

void check_joint_vector(Rules& r, const std::string& name, const Eigen::VectorXd& v, int n) {
  if (v.size() != n)
    r.fail(name, "has " + std::to_string(v.size()) + " values, must have one for each of the " +
                     std::to_string(n) + " joints");
  for (Eigen::Index i = 0; i < v.size(); ++i)
    if (!std::isfinite(v[i])) r.fail(at(name, static_cast<std::size_t>(i)), "is not finite");
}

void check_limits(Rules& r, const std::string& name, const Eigen::VectorXd& q, const model::Chain& chain) {
  for (int i = 0; i < std::min(chain.n(), static_cast<int>(q.size())); ++i) {
    const model::Joint& joint = chain.joint(i);
    if (q[i] < joint.limits.lower || q[i] > joint.limits.upper)
      r.fail(at(name, static_cast<std::size_t>(i)),
             "= " + number(q[i]) + ", must be within the limits of joint " + joint.name + ", [" +
                 number(joint.limits.lower) + ", " + number(joint.limits.upper) + "]");
  }
}

void check_robot(Rules& r, const Robot& robot) {
  for (std::size_t i = 0; i < robot.shapes.size(); ++i) {
    const LinkShape& s = robot.shapes[i];
    const std::string name = at("robot.shapes", i) + ".";
    if (s.link < -1 || s.link >= robot.chain.n())
      r.fail(name + "link", "= " + std::to_string(s.link) + ", no such link");
    check_shape(r, name, s.shape);
    check_pose(r, name, s.X_LS);
  }
}

void check_goal(Rules& r, const Scene& s) {
  if (!s.goal) return;
  const Goal& goal = *s.goal;
  if (!s.steered) r.fail("goal", "is given, but steered is false: nothing would go there");
  if (goal.id == 0) r.fail("goal.id", "= 0, must be >= 1");
  if (!goal.V_WG.allFinite()) r.fail("goal.velocity_mps", "has a number that is not finite");
  if (goal.kind == GoalKind::joints) {
    check_joint_vector(r, "goal.joints", goal.joints, s.robot.chain.n());
    check_limits(r, "goal.joints", goal.joints, s.robot.chain);
  } else {
    check_pose(r, "goal.", goal.X_WG);
  }
}

void check_obstacle(Rules& r, const std::string& name, const ScriptedObstacle& o) {
  check_shape(r, name, o.at_start.shape);
  check_pose(r, name, o.at_start.X_WO);
  r.not_negative(name + "sigma_m", o.at_start.sigma_m);
  if (!o.velocity_mps.allFinite()) r.fail(name + "velocity_mps", "has a number that is not finite");
  if (!o.amplitude_m.allFinite()) r.fail(name + "sinusoid.amplitude_m", "has a number that is not finite");
  r.not_negative(name + "sinusoid.frequency_hz", o.frequency_hz);
  if (!std::isfinite(o.phase_rad)) r.fail(name + "sinusoid.phase_rad", "is not finite");
  const bool swings = !o.amplitude_m.isZero(0);
  if (swings && !o.velocity_mps.isZero(0))
    r.fail(name + "sinusoid", "stands beside velocity_mps, must be one motion");
  if (swings && o.frequency_hz == 0)
    r.fail(name + "sinusoid.frequency_hz", "= 0, must be > 0 where amplitude_m is not zero");
}

void check_stream(Rules& r, const PerceptionOptions& o) {
  const Stream& s = *o.stream;
  check_pose(r, "stream.", s.X_WS);
  r.positive("stream.scale", s.scale);
  r.positive("stream.rate", s.rate);
  r.positive("stream.glitch_mps", s.glitch_mps);
  if (!std::isfinite(s.start_s)) r.fail("stream.start_s", "is not finite");
  if (s.samples.empty() && s.empty_s.empty()) r.fail("stream.path", "has no samples");
  constexpr double inf = std::numeric_limits<double>::infinity();
  double first_s = inf, last_s = -inf;
  const auto span = [&](double t_s) { first_s = std::min(first_s, t_s), last_s = std::max(last_s, t_s); };
  for (const StreamSample& sample : s.samples) span(sample.t_s);
  for (const double t_s : s.empty_s) span(t_s);
  last_s = std::min(last_s, s.until_s);
  r.must(s.until_s >= first_s || std::isinf(first_s), "stream.until_s", s.until_s,
         ">= the time of the first sample, " + std::to_string(first_s));
  if (!s.loop && last_s >= first_s && std::isfinite(s.start_s))
    r.must(s.start_s <= last_s, "stream.start_s", s.start_s,
           "<= the time of the last sample, " + std::to_string(last_s));
  std::set<std::uint32_t> ids;
  for (const StreamSample& sample : s.samples) ids.insert(sample.id);
  if (ids.size() + o.obstacles.size() > kMaxObstacles)
    r.fail("stream.path", "has " + std::to_string(ids.size()) + " ids, one set holds at most 4096 obstacles");
  for (std::size_t i = 0; i < o.obstacles.size(); ++i)
    if (ids.count(o.obstacles[i].at_start.id) != 0)
      r.fail(at("obstacles", i) + ".id",
             "= " + std::to_string(o.obstacles[i].at_start.id) + " is also an id of the stream");
}

void check_flaws(Rules& r, const Flaws& f) {
  r.not_negative("flaws.noise_m", f.noise_m);
  r.within("flaws.dropout", f.dropout, 0, 1);
  r.not_negative("flaws.latency_s", f.latency_s);
  r.must(f.view_rad > 0 && f.view_rad <= 3.1415926535897936, "flaws.view_rad", f.view_rad, "in (0, pi]");
  r.positive_or_inf("flaws.range_m", f.range_m);
  if (!f.eye_m.allFinite()) r.fail("flaws.eye_m", "has a number that is not finite");
  if (!f.look.allFinite() || f.look.isZero())
    r.fail("flaws.look", "must be a direction: finite and not zero");
}

/// True where all joints turn about parallel axes.
bool is_planar(const model::Chain& chain) {
  lie::Pose X_WB = chain.X_WB0();
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (int i = 0; i < chain.n(); ++i) {
    const model::Joint& joint = chain.joint(i);
    if (joint.kind == model::JointKind::prismatic) return false;
    X_WB = X_WB * joint.X_PJ;
    const Eigen::Vector3d axis_W = X_WB.R * joint.axis;
    if (i == 0) first = axis_W;
    if (first.cross(axis_W).norm() > kUnit) return false;
  }
  return true;
}

void check_bus(Rules& r, const std::string& service, const std::string& bus) {
  if (!bus.empty() && bus != "inproc" && bus != "fastdds" && bus != "cyclonedds")
    r.fail(service + ".bus", "= \"" + bus + "\", must be inproc, fastdds or cyclonedds");
}

/// Largest speed a scripted obstacle reaches.
double top_speed_mps(const PerceptionOptions& o) {
  double top = 0;
  for (const ScriptedObstacle& x : o.obstacles)
    top =
        std::max({top, x.velocity_mps.norm(), 2 * std::numbers::pi * x.frequency_hz * x.amplitude_m.norm()});
  return top;
}

}  // namespace

Problems problems(const PerceptionOptions& o) {
  Rules r("perception.");
  r.must(o.rate_hz > 0 && o.rate_hz <= 1e4, "rate_hz", o.rate_hz, "> 0 and <= 10000");
  if (o.obstacles.size() > kMaxObstacles)
    r.fail("obstacles", "has " + std::to_string(o.obstacles.size()) + " obstacles, at most 4096 are allowed");
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; i < o.obstacles.size(); ++i) {
    check_obstacle(r, at("obstacles", i) + ".", o.obstacles[i]);
    const std::uint32_t id = o.obstacles[i].at_start.id;
    if (!ids.insert(id).second)
      r.fail(at("obstacles", i) + ".id", "= " + std::to_string(id) + " is used twice");
  }
  if (o.stream) check_stream(r, o);
  if (o.flaws) check_flaws(r, *o.flaws);
  return r.take();
}

Problems problems(const Scene& s) {
  Rules r("");
  r.must(s.arm >= 1 && s.arm <= kMaxArm, "arm", s.arm, "in [1, 268435455]");
  check_robot(r, s.robot);
  const int n = s.robot.chain.n();
  check_joint_vector(r, "q0", s.q0, n);
  check_limits(r, "q0", s.q0, s.robot.chain);
  check_joint_vector(r, "qd0", s.qd0, n);
  check_goal(r, s);
  r.positive("duration_s", s.duration_s);
  if (s.planner.kc == 1 && is_planar(s.robot.chain))
    r.fail("planner.kc", "= 1, must be 0 or > 1 on a planar arm");
  check_bus(r, "dynamics", s.bus.dynamics);
  check_bus(r, "planner", s.bus.planner);
  check_bus(r, "perception", s.bus.perception);
  Problems all = r.take();
  append(all, problems(s.dynamics));
  append(all, problems(s.planner));
  append(all, problems(s.perception));
  append(all, problems(s.accuracy));
  append(all, lock_problems(s));
  return all;
}

std::uint64_t fingerprint(const Scene& s) { return hashed(s.robot.urdf + '\0', hashed(s.text + '\0')); }

namespace {

// G of Eq. (20) where it is largest.
double greatest_gain(const PlannerOptions& o) {
  switch (o.gain_form) {
    case GainForm::F1:
      return std::expm1(std::numbers::pi / 2);
    case GainForm::F2:
      return std::exp(1 / o.phi_min_rad);
    case GainForm::F3:
      return std::exp(std::numbers::pi / 2 - 1);
    case GainForm::S:
      break;
  }
  return 0;  // grows with speed
}

// What goes too far within one period: the arm, and the turn of a force that is applied explicitly.
void append_warnings_of_the_period(const Scene& s, std::vector<std::string>& out) {
  const PlannerOptions& o = s.planner;
  const double period_s = o.period_steps * s.dynamics.dt_s;
  const double way = o.vmax_mps * period_s;
  if (o.method == Method::gyro && o.barrier_gain > 0 && std::isfinite(way) && !(way < 0.5 * o.dmin_m))
    out.push_back("planner.vmax_mps * period = " + number(way) + " m is not below half of dmin_m = " +
                  number(o.dmin_m) + ": the arm may pass the clearance within a period");
  const double overshoots = o.kobs * greatest_gain(o) * period_s;  // where k dt = 1
  if (o.method == Method::gyro_paper && o.mapping == Mapping::paper && overshoots > 0.25 * o.rho0_m)
    out.push_back("planner.kobs * G * period = " + number(overshoots) +
                  " m: nearer than that to an obstacle, of rho0_m = " + number(o.rho0_m) +
                  ", the gyroscopic force overshoots within a period");
}

}  // namespace

std::vector<std::string> warnings(const Scene& s) {
  std::vector<std::string> out = s.robot.warnings;
  const PlannerOptions& o = s.planner;
  const double closing = std::min(o.vmax_mps, o.barrier_gain * o.rho0_m) +
                         top_speed_mps(s.perception);  // the barrier needs g rho0 >= it
  if (s.steered && o.method == Method::gyro && o.barrier_gain > 0 && o.barrier_gain * o.rho0_m < closing)
    out.push_back("planner.barrier_gain * rho0_m = " + number(o.barrier_gain * o.rho0_m) +
                  " m/s is below the largest closing speed " + number(closing) +
                  " m/s: the barrier may come too late");
  if (s.steered) append_warnings_of_the_period(s, out);
  if (s.steered && !s.goal) out.push_back("no goal: the planner stays IDLE until one is sent");
  if (s.steered && o.period_steps * s.dynamics.dt_s > 0.02)
    out.push_back("a command every " + number(o.period_steps * s.dynamics.dt_s) + " s is slow for avoidance");
  return out;
}

const char* to_string(GoalKind v) {
  switch (v) {
    case GoalKind::position:
      return "position";
    case GoalKind::pose:
      return "pose";
    case GoalKind::joints:
      return "joints";
  }
  return "?";
}

}  // namespace hamel::scene
