#include "common/files/scene_convert.h"

#include <scene.pb.h>

namespace hamel::files {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

/// Reads fields of one message by name into variables that hold their defaults; notes lists of a wrong
/// length.
class Fields {
 public:
  Fields(const Message& message, std::string prefix, Problems& missing)
      : m_(message), prefix_(std::move(prefix)), missing_(missing) {}

  void operator()(const char* name, double& v) const {
    if (has(name)) v = r().GetDouble(m_, f(name));
  }
  void operator()(const char* name, int& v) const {
    if (has(name)) v = r().GetInt32(m_, f(name));
  }
  void operator()(const char* name, bool& v) const {
    if (has(name)) v = r().GetBool(m_, f(name));
  }
  void operator()(const char* name, std::uint32_t& v) const {
    if (has(name)) v = r().GetUInt32(m_, f(name));
  }
  void operator()(const char* name, std::uint64_t& v) const {
    if (has(name)) v = r().GetUInt64(m_, f(name));
  }
  void operator()(const char* name, std::string& v) const {
    if (has(name)) v = r().GetString(m_, f(name));
  }

  /// Enumerations of the schema and of common/scene have the same names in the same order (a test compares
  /// them).
  template <class Enum>
  requires std::is_enum_v<Enum>
  void operator()(const char* name, Enum& v) const {
    if (has(name)) v = static_cast<Enum>(r().GetEnumValue(m_, f(name)));
  }

  /// Three numbers or none.
  void operator()(const char* name, Eigen::Vector3d& v) const {
    const int size = r().FieldSize(m_, f(name));
    if (size != 0 && size != 3)
      missing_.push_back({prefix_ + name, "has " + std::to_string(size) + " numbers, must have 3"});
    for (int i = 0; i < 3 && size == 3; ++i) v[i] = r().GetRepeatedDouble(m_, f(name), i);
  }

  std::optional<Eigen::VectorXd> list(const char* name) const {
    const int size = r().FieldSize(m_, f(name));
    if (size == 0) return {};
    Eigen::VectorXd v(size);
    for (int i = 0; i < size; ++i) v[i] = r().GetRepeatedDouble(m_, f(name), i);
    return v;
  }

  /// position_m and rpy_rad.
  void pose(lie::Pose& X) const {
    Eigen::Vector3d rpy = Eigen::Vector3d::Zero();
    (*this)("position_m", X.p);
    (*this)("rpy_rad", rpy);
    if (given("rpy_rad")) X.R = rotation_from_rpy(rpy);
  }

  bool given(const char* name) const {
    return f(name)->is_repeated() ? r().FieldSize(m_, f(name)) > 0 : r().HasField(m_, f(name));
  }
  void require(const char* name) const {
    if (!given(name)) missing_.push_back({prefix_ + name, "is missing"});
  }

 private:
  const google::protobuf::Reflection& r() const { return *m_.GetReflection(); }
  const FieldDescriptor* f(const char* name) const { return m_.GetDescriptor()->FindFieldByName(name); }
  bool has(const char* name) const { return r().HasField(m_, f(name)); }

  const Message& m_;
  std::string prefix_;
  Problems& missing_;
};

void read_dynamics(const Fields& read, scene::DynamicsOptions& o, std::string& bus) {
  read("tier", o.tier);
  read("dt_s", o.dt_s);
  read("alpha", o.alpha);
  read("stages", o.stages);
  read("root", o.root);
  read("start", o.start);
  read("tolerance_Nm", o.tolerance_Nm);
  read("tolerance_rel", o.tolerance_rel);
  read("max_iterations", o.max_iterations);
  read("max_subdivisions", o.max_subdivisions);
  read("stop_stiffness", o.stop_stiffness);
  read("space", o.space);
  read("on_silence", o.on_silence);
  read("bus", bus);
}

void read_planner_forces(const Fields& read, scene::PlannerOptions& o) {
  read("method", o.method);
  read("kp", o.kp);
  read("kv", o.kv);
  read("vmax_mps", o.vmax_mps);
  read("angular_vmax_radps", o.angular_vmax_radps);
  read("amax", o.amax);
  read("damping", o.damping);
  read("eta", o.eta);
  read("rho0_m", o.rho0_m);
  read("kobs", o.kobs);
  read("gain_form", o.gain_form);
  read("mapping", o.mapping);
  read("pairs", o.pairs);
  read("relative_velocity", o.relative_velocity);
  read("phi_min_rad", o.phi_min_rad);
  read("c0", o.c0);
  read("lambda2", o.lambda2);
  read("lambda2_relative", o.lambda2_relative);
  read("dmin_m", o.dmin_m);
  read("barrier_gain", o.barrier_gain);
  read("kc", o.kc);
  read("flip_time_s", o.flip_time_s);
  read("limit_weight", o.limit_weight);
}

void read_planner(const Fields& read, scene::PlannerOptions& o, std::string& bus) {
  read_planner_forces(read, o);
  read("period_steps", o.period_steps);
  read("progress_window_s", o.progress_window_s);
  read("goal_tolerance_m", o.goal_tolerance_m);
  read("goal_tolerance_rad", o.goal_tolerance_rad);
  read("goal_tolerance_joint", o.goal_tolerance_joint);
  read("goal_speed", o.goal_speed);
  read("goal_hold_s", o.goal_hold_s);
  read("stale_brake_s", o.stale_brake_s);
  read("stale_slow_s", o.stale_slow_s);
  read("assumed_speed_mps", o.assumed_speed_mps);
  read("assumed_acceleration_mps2", o.assumed_acceleration_mps2);
  read("stale_state_s", o.stale_state_s);
  read("brake_rate", o.brake_rate);
  read("ramp_s", o.ramp_s);
  read("unreachable", o.unreachable);
  read("escapes", o.escapes);
  read("escape_rollouts", o.escape_rollouts);
  read("escape_horizon_s", o.escape_horizon_s);
  read("escape_delay_s", o.escape_delay_s);
  read("bus", bus);
}

geometry::Shape read_shape(const text::Obstacle& m, const std::string& prefix, Problems& missing) {
  using geometry::ShapeKind;
  geometry::Shape shape;
  const auto round = [&](const Message& round_shape, const char* name, bool long_one) {
    const Fields read(round_shape, prefix + name + ".", missing);
    read.require("radius_m");
    read("radius_m", shape.dims_m[0]);
    if (!long_one) return;
    read.require("length_m");
    read("length_m", shape.dims_m[1]);
  };
  switch (m.shape_case()) {
    case text::Obstacle::kSphere:
      shape.kind = ShapeKind::sphere;
      round(m.sphere(), "sphere", false);
      break;
    case text::Obstacle::kCapsule:
      shape.kind = ShapeKind::capsule;
      round(m.capsule(), "capsule", true);
      break;
    case text::Obstacle::kCylinder:
      shape.kind = ShapeKind::cylinder;
      round(m.cylinder(), "cylinder", true);
      break;
    case text::Obstacle::kBox: {
      shape.kind = ShapeKind::box;
      const Fields read(m.box(), prefix + "box.", missing);
      read.require("size_m");
      shape.dims_m.setOnes();
      read("size_m", shape.dims_m);
      break;
    }
    case text::Obstacle::kHalfSpace:
      shape.kind = ShapeKind::half_space;
      break;
    case text::Obstacle::SHAPE_NOT_SET:
      missing.push_back(
          {prefix + "shape", "is missing, must be one of sphere, capsule, cylinder, box, half_space"});
  }
  return shape;
}

scene::ScriptedObstacle read_obstacle(const text::Obstacle& m, int i, Problems& missing) {
  const std::string prefix = "perception.obstacles[" + std::to_string(i) + "].";
  const Fields read(m, prefix, missing);
  scene::ScriptedObstacle o;
  o.at_start.id = static_cast<std::uint32_t>(i + 1);
  read("id", o.at_start.id);
  o.at_start.shape = read_shape(m, prefix, missing);
  if (!m.has_half_space()) read.require("position_m");
  read.pose(o.at_start.X_WO);
  read("velocity_mps", o.velocity_mps);
  read("sigma_m", o.at_start.sigma_m);
  if (m.has_sinusoid()) {
    const Fields swing(m.sinusoid(), prefix + "sinusoid.", missing);
    swing.require("amplitude_m");
    swing.require("frequency_hz");
    swing("amplitude_m", o.amplitude_m);
    swing("frequency_hz", o.frequency_hz);
    swing("phase_rad", o.phase_rad);
  }
  return o;
}

void read_flaws(const text::Flaws& m, SceneParts& out) {
  const Fields read(m, "perception.flaws.", out.missing);
  scene::Flaws& f = out.perception.flaws.emplace();
  read("seed", f.seed);
  read("noise_m", f.noise_m);
  read("dropout", f.dropout);
  read("latency_s", f.latency_s);
  read("eye_m", f.eye_m);
  read("look", f.look);
  read("view_rad", f.view_rad);
  read("range_m", f.range_m);
}

void read_perception(const text::Perception& m, SceneParts& out) {
  const Fields read(m, "perception.", out.missing);
  read("rate_hz", out.perception.rate_hz);
  read("bus", out.bus.perception);
  for (int i = 0; i < m.obstacles_size(); ++i)
    out.perception.obstacles.push_back(read_obstacle(m.obstacles(i), i, out.missing));
  if (m.has_flaws()) read_flaws(m.flaws(), out);
  if (!m.has_stream()) return;
  const Fields stream(m.stream(), "perception.stream.", out.missing);
  scene::Stream& s = out.perception.stream.emplace();
  stream.require("path");
  stream("path", s.path);
  stream.pose(s.X_WS);
  stream("scale", s.scale);
  stream("rate", s.rate);
  stream("start_s", s.start_s);
  stream("loop", s.loop);
  stream("glitch_mps", s.glitch_mps);
  stream("until_s", s.until_s);
  stream("causal", s.causal);
  stream("topic", s.topic);
  out.stream_start_given = m.stream().has_start_s();
}

scene::Goal read_goal(const text::Goal& m, Problems& missing) {
  const Fields read(m, "goal.", missing);
  scene::Goal goal;
  goal.id = 1;
  read("id", goal.id);
  const bool joints = read.given("joints"), turned = read.given("rpy_rad");
  if (joints && (turned || read.given("position_m")))
    missing.push_back({"goal.joints", "stands beside position_m or rpy_rad, must be one kind of goal"});
  if (!joints) read.require("position_m");
  goal.kind = joints ? scene::GoalKind::joints : turned ? scene::GoalKind::pose : scene::GoalKind::position;
  if (joints) goal.joints = *read.list("joints");
  read.pose(goal.X_WG);
  Eigen::Vector3d v = Eigen::Vector3d::Zero(), w = v;
  read("velocity_mps", v);
  read("angular_velocity_radps", w);
  goal.V_WG << w, v;
  return goal;
}

void read_place(const text::Scene& m, SceneParts& out) {
  const Fields robot(m.robot(), "robot.", out.missing);
  robot.require("urdf");
  robot("tip", out.place.tip);
  robot.pose(out.place.X_WB0);
  if (m.robot().has_self_collision()) out.self_collision = m.robot().self_collision();
  for (int i = 0; i < m.robot().allowed_contact_size(); ++i) {
    const text::AllowedContact& pair = m.robot().allowed_contact(i);
    if (pair.link_size() == 2)
      out.allowed_contacts.emplace_back(pair.link(0), pair.link(1));
    else
      out.missing.push_back({"robot.allowed_contact[" + std::to_string(i) + "]", "must name two links"});
  }
  if (!out.place.X_WB0.p.allFinite() || !out.place.X_WB0.R.allFinite())
    out.missing.push_back({"robot.position_m", "or rpy_rad has a number that is not finite"});
  const Fields read(m, "", out.missing);
  read("gravity_mps2", out.place.gravity_W_mps2);
  if (!out.place.gravity_W_mps2.allFinite())
    out.missing.push_back({"gravity_mps2", "has a number that is not finite"});
}

void read_reduce(const Fields& read, scene::ReduceOptions& o) {
  read("locked", o.locked);
  read("plane", o.plane);
  read("gravity", o.gravity);
  read("obstacles", o.obstacles);
  read("links", o.links);
  read("rate", o.rate);
  read("step", o.step);
  read("self", o.self);
  read("shapes", o.shapes);
  read("merge", o.merge);
  read("requery", o.requery);
  read("cycle", o.cycle);
}

void read_accuracy(const Fields& read, scene::Accuracy& o) {
  read("joint_error_rad", o.joint_error_rad);
  read("energy_error_rel", o.energy_error_rel);
  read("horizon_s", o.horizon_s);
  read("obstacle_error_m", o.obstacle_error_m);
}

scene::Lock read_lock(const Fields& read) {
  scene::Lock lock;
  read.require("joint");
  read("joint", lock.joint);
  if (read.given("value")) read("value", lock.value.emplace());
  return lock;
}

}  // namespace

SceneParts to_parts(const text::Scene& m) {
  SceneParts out;
  const Fields read(m, "", out.missing);
  read("name", out.name);
  read("arm", out.arm);
  read_place(m, out);
  out.q0 = read.list("q0");
  out.qd0 = read.list("qd0");
  if (m.has_goal()) out.goal = read_goal(m.goal(), out.missing);
  read("steered", out.steered);
  read_dynamics({m.dynamics(), "dynamics.", out.missing}, out.dynamics, out.bus.dynamics);
  read_planner({m.planner(), "planner.", out.missing}, out.planner, out.bus.planner);
  read_perception(m.perception(), out);
  read("duration_s", out.duration_s);
  read("stop", out.stop);
  read("fidelity", out.reduce.fidelity);
  read_reduce({m.reduce(), "reduce.", out.missing}, out.reduce);
  read_accuracy({m.accuracy(), "accuracy.", out.missing}, out.accuracy);
  for (int i = 0; i < m.locked_size(); ++i)
    out.locked.push_back(read_lock({m.locked(i), "locked[" + std::to_string(i) + "].", out.missing}));
  return out;
}

Problems to_options(const text::Planner& message, scene::PlannerOptions& options) {
  Problems missing;
  std::string bus;
  read_planner({message, "planner.", missing}, options, bus);
  return missing;
}

}  // namespace hamel::files
