#include "clients/hamel/bench_families.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "clients/hamel/judge.h"
#include "clients/hamel/robots.h"
#include "common/base/hash.h"
#include "common/base/random.h"
#include "common/files/urdf.h"
#include "common/rbd/rbd.h"
#include "common/scene/self_links.h"

namespace hamel::client {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::Method;

constexpr double kStep_s = 2e-3;
constexpr double kPlanarRadius_m = 0.05;  // of a link
constexpr double kStops_Nm = 500;         // hard stops at joint limits, for methods that know none

class Dice : public SplitMix64 {
 public:
  using SplitMix64::SplitMix64;
  Vector3d direction() {
    for (;;) {
      const Vector3d v(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      if (v.norm() > 0.1 && v.norm() <= 1) return v.normalized();
    }
  }
};

bool is_planar(const Cell& cell) { return cell.family.starts_with("planar") || cell.family == "example_5_2"; }
bool is_moving(const Cell& cell) { return cell.family.ends_with("moving"); }

/// What differs between the two arms' scenes.
struct Workshop {
  double near_m, far_m;                  // spheres' centres, from the shoulder
  double least_radius_m, most_radius_m;  // of spheres
  double start_clear_m, goal_clear_m;
  double way_m;         // from start to goal, at least
  double base_clear_m;  // moving spheres stay so far from what cannot get out of their way
  double duration_s;
};
constexpr Workshop kPlanar{0.5, 3.2, 0.20, 0.40, 0.10, 0.03, 1.0, 0.35, 15};
constexpr Workshop kPanda{0.25, 0.80, 0.04, 0.11, 0.05, 0.02, 0.3, 0.22, 12};

scene::Scene empty_scene(const scene::Robot& robot) {
  scene::Scene s{"", "", 1, robot, {}, {}, {}, true, {}, {}, {}, {}, 10, scene::StopRule::when_reached};
  s.dynamics.dt_s = kStep_s;
  s.dynamics.stop_stiffness = kStops_Nm;
  s.qd0 = VectorXd::Zero(robot.chain.n());
  s.goal = scene::Goal{};
  s.goal->id = 1;
  return s;
}

VectorXd random_configuration(const model::Chain& chain, Dice& dice) {
  VectorXd q(chain.n());
  for (int i = 0; i < chain.n(); ++i) {
    const model::JointLimits& limits = chain.joint(i).limits;
    const double margin = 0.05;
    q[i] = dice.uniform(std::max(limits.lower + margin, -std::numbers::pi),
                        std::min(limits.upper - margin, std::numbers::pi));
  }
  return q;
}

/// Draws until start, goal and obstacles fit together.
class Drawing {
 public:
  Drawing(const Cell& cell, const BenchRobots& robots, std::uint64_t seed)
      : cell_(cell),
        robot_(is_planar(cell) ? robots.planar : robots.panda),
        shop_(is_planar(cell) ? kPlanar : kPanda),
        dice_(seed),
        judge_(robot_),
        ws_(robot_.chain),
        scene_(empty_scene(robot_)) {
    shoulder_ = robot_.chain.X_WB0() * robot_.chain.joint(0).X_PJ.p;
  }

  scene::Scene draw() {
    scene_.duration_s = shop_.duration_s;
    for (;;) {
      scene_.q0 = random_configuration(robot_.chain, dice_);
      const VectorXd q_goal = random_configuration(robot_.chain, dice_);
      if (!free_of_itself(scene_.q0) || !free_of_itself(q_goal)) continue;
      rbd::positions(robot_.chain, scene_.q0, ws_);
      const Vector3d tip = rbd::tip(robot_.chain, ws_).p;
      rbd::positions(robot_.chain, q_goal, ws_);
      scene_.goal->X_WG = rbd::tip(robot_.chain, ws_);
      if ((scene_.goal->X_WG.p - tip).norm() < shop_.way_m) continue;
      if (draw_spheres(q_goal)) return std::move(scene_);
    }
  }

 private:
  // The floor of a real cell is not modelled, but nothing is asked for below it.
  bool free_of_itself(const VectorXd& q) {
    if (judge_.clearance(q, {}) <= 0.02) return false;
    if (is_planar(cell_)) return true;
    rbd::positions(robot_.chain, q, ws_);
    return rbd::tip(robot_.chain, ws_).p.z() > 0.05;
  }

  bool draw_spheres(const VectorXd& q_goal) {
    scene_.perception.obstacles.clear();
    for (int k = 0; k < cell_.spheres; ++k) {
      int tries = 0;
      while (tries < 50 && !draw_sphere(k, q_goal)) ++tries;
      if (tries == 50) return false;
    }
    return true;
  }

  bool draw_sphere(int k, const VectorXd& q_goal) {
    scene::ScriptedObstacle o;
    o.at_start.id = static_cast<std::uint32_t>(k + 1);
    const double radius = dice_.uniform(shop_.least_radius_m, shop_.most_radius_m);
    o.at_start.shape = {geometry::ShapeKind::sphere, {radius, 0, 0}};
    const Vector3d place = random_place();
    if (!is_moving(cell_)) {
      o.at_start.X_WO.p = place;
      const std::array one{o.at_start};
      if (judge_.clearance(scene_.q0, one) < shop_.start_clear_m ||
          judge_.clearance(q_goal, one) < shop_.goal_clear_m)
        return false;
    } else {
      const double speed = dice_.uniform(0.1, 1), passes_s = dice_.uniform(0, 0.5 * shop_.duration_s);
      Vector3d along = dice_.direction();
      if (is_planar(cell_)) along = Vector3d(along.x(), along.y(), 0).normalized();
      o.velocity_mps = speed * along;
      o.at_start.X_WO.p = place - passes_s * o.velocity_mps;
      if (!spares_start(o) || !spares_base(o)) return false;
    }
    scene_.perception.obstacles.push_back(o);
    return true;
  }

  Vector3d random_place() {
    for (;;) {
      Vector3d p(dice_.uniform(-1, 1), dice_.uniform(-1, 1), is_planar(cell_) ? 0.0 : dice_.uniform(-1, 1));
      p *= shop_.far_m;
      if (p.norm() > shop_.far_m || p.norm() < shop_.near_m) continue;
      return shoulder_ + p;
    }
  }

  // Not in reach of the standing arm for half a second.
  bool spares_start(scene::ScriptedObstacle o) {
    for (int k = 0; k <= 10; ++k) {
      const std::array one{o.at_start};
      if (judge_.clearance(scene_.q0, one) < shop_.start_clear_m) return false;
      o.at_start.X_WO.p += 0.05 * o.velocity_mps;
    }
    return true;
  }

  // Keeps away from what cannot give way: the base, and what turns on the line from it to the second joint.
  bool spares_base(scene::ScriptedObstacle o) {
    const Vector3d foot = robot_.chain.X_WB0().p, up = shoulder_ - foot, start = o.at_start.X_WO.p;
    const double room = o.at_start.shape.dims_m[0] + shop_.base_clear_m;
    for (double t = 0; t <= shop_.duration_s; t += 0.02) {
      const Vector3d c = start + t * o.velocity_mps;
      const double s = up.isZero() ? 0 : std::clamp((c - foot).dot(up) / up.squaredNorm(), 0.0, 1.0);
      if ((c - foot - s * up).norm() < room) return false;
      o.at_start.X_WO.p = c;
      const std::array one{o.at_start};
      if ((c - foot).norm() < 1 && judge_.clearance_of_link(-1, scene_.q0, one) < 0.05) return false;
    }
    return true;
  }

  const Cell& cell_;
  const scene::Robot& robot_;
  const Workshop& shop_;
  Dice dice_;
  Judge judge_;
  rbd::Workspace ws_;
  scene::Scene scene_;
  Vector3d shoulder_;
};

/// Example 5.2 with everything moved a little: centre and target +-0.4 and +-0.5 m, radius 0.15 to 0.35 m,
/// joints +-0.1 rad.
scene::Scene draw_example_5_2(const scene::Robot& robot, std::uint64_t seed) {
  Dice dice(seed);
  Judge judge(robot);
  scene::Scene s = empty_scene(robot);
  s.duration_s = 40;
  s.q0 = VectorXd::Zero(robot.chain.n());
  scene::ScriptedObstacle o;
  o.at_start.id = 1;
  for (;;) {
    for (double& q : s.q0) q = dice.uniform(-0.1, 0.1);
    o.at_start.shape = {geometry::ShapeKind::sphere, {dice.uniform(0.15, 0.35), 0, 0}};
    o.at_start.X_WO.p = {2.4 + dice.uniform(-0.4, 0.4), 2.2 + dice.uniform(-0.4, 0.4), 0};
    s.goal->X_WG.p = {2 + dice.uniform(-0.5, 0.5), 3 + dice.uniform(-0.5, 0.5), 0};
    const double room = (s.goal->X_WG.p - o.at_start.X_WO.p).norm() - o.at_start.shape.dims_m[0];
    const std::array one{o.at_start};
    if (room > kPlanarRadius_m + 0.05 && s.goal->X_WG.p.norm() < 3.9 && judge.clearance(s.q0, one) > 0.05)
      break;
  }
  s.perception.obstacles = {o};
  return s;
}

scene::Robot planar_arm() {
  model::ChainSpec spec;
  spec.name = "planar_4";
  spec.gravity_W_mps2.setZero();
  std::vector<scene::LinkShape> shapes;
  for (int i = 0; i < 4; ++i) {
    model::Joint joint;
    joint.name = "joint" + std::to_string(i + 1);
    if (i > 0) joint.X_PJ.p = Vector3d::UnitX();
    spec.joints.push_back(joint);
    const Vector3d rod(1e-3, 1.0 / 12, 1.0 / 12);
    spec.links.push_back({"link" + std::to_string(i + 1), {1, {0.5, 0, 0}, rod.asDiagonal()}});
    scene::LinkShape shape;
    shape.link = i;
    shape.shape = {geometry::ShapeKind::capsule, {kPlanarRadius_m, 1, 0}};
    shape.X_LS.p = {0.5, 0, 0};
    shape.X_LS.R = Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitY()).toRotationMatrix();
    shapes.push_back(shape);
  }
  spec.X_NE.p = Vector3d::UnitX();
  spec.tip_name = "tip";
  return {"planar_4", "", model::build(std::move(spec)).value(), std::move(shapes), {}};
}

/// The same arm without limits of torque.
void lift_torque_limits(scene::Robot& robot) {
  model::ChainSpec spec = robot.chain.spec();
  for (model::Joint& j : spec.joints) j.limits.effort = scene::kInf;
  robot.chain = model::build(std::move(spec)).value();
}

}  // namespace

Checked<std::vector<Cell>> cells(const std::vector<std::string>& families, const std::vector<int>& spheres) {
  std::vector<Cell> all;
  for (const char* family : {"planar_static", "planar_moving", "panda_static", "panda_moving"}) {
    const bool planar = std::string(family).starts_with("planar");
    const bool moving = std::string(family).ends_with("moving");
    const std::vector<int> counts = moving   ? std::vector{1, 4, 8}
                                    : planar ? std::vector{1, 2, 4, 8}
                                             : std::vector{1, 4, 8, 16};
    for (const int n : counts) all.push_back({family, n, ""});
  }
  for (const char* variant :
       {"damping 0.5, vmax 1", "damping 0.5, no vmax", "damping 2, vmax 1", "damping 2, no vmax"})
    all.push_back({"example_5_2", 1, variant});
  Problems found;
  for (const std::string& f : families)
    if (std::none_of(all.begin(), all.end(), [&](const Cell& c) { return c.family == f; }))
      found.push_back({"--family " + f,
                       "is none of planar_static, planar_moving, panda_static, panda_moving, example_5_2"});
  if (!found.empty()) return found;
  std::erase_if(all, [&](const Cell& c) {
    const bool other_family =
        !families.empty() && std::find(families.begin(), families.end(), c.family) == families.end();
    return other_family ||
           (!spheres.empty() && std::find(spheres.begin(), spheres.end(), c.spheres) == spheres.end());
  });
  if (all.empty())
    return Problems{{"--spheres", "leaves no cell: static ones have 1, 2, 4, 8, 16, moving ones 1, 4, 8"}};
  return all;
}

Checked<BenchRobots> bench_robots(ArmModel model) {
  files::RobotPlace place;
  place.tip = "panda_tcp";
  if (model == ArmModel::prototype) place.gravity_W_mps2.setZero();
  auto panda = files::parse_urdf(std::string(panda_urdf()), "panda.urdf", place);
  if (!panda) return panda.error();
  BenchRobots robots{planar_arm(), std::move(panda).value()};
  if (model == ArmModel::prototype) {
    lift_torque_limits(robots.panda);
    return robots;
  }
  scene::watch(robots.panda, scene::self_links(robots.panda).watched);
  return robots;
}

scene::Scene draw_scene(const Cell& cell, const BenchRobots& robots, std::uint64_t seed, std::size_t index) {
  std::uint64_t h = hashed(cell.family, kHashStart ^ (seed * SplitMix64::kStep));
  h = hashed(std::to_string(cell.spheres) + "/" + std::to_string(index), h);  // variants share their scenes
  scene::Scene s =
      cell.family == "example_5_2" ? draw_example_5_2(robots.planar, h) : Drawing(cell, robots, h).draw();
  s.name = cell.family + "_" + std::to_string(cell.spheres) + "_" + std::to_string(index);
  return s;
}

scene::PlannerOptions settings(const Cell& cell, Method method) {
  scene::PlannerOptions o;
  o.method = method;
  o.lambda2 = 1e-3;
  if (is_planar(cell)) {
    const bool example = cell.family == "example_5_2";
    o.kp = 10;
    o.kv = example ? 6.32 : 6.3;
    o.vmax_mps = cell.variant.ends_with("no vmax") ? scene::kInf : 1;
    o.damping = cell.variant.starts_with("damping 2") ? 2 : 0.5;
    o.rho0_m = example ? 0.5 : 0.4;
    o.eta = 0.02;
  } else {
    o.kp = 30;
    o.kv = 11;
    o.vmax_mps = 0.5;
    o.angular_vmax_radps = 1.5;
    o.damping = 1;
    o.rho0_m = 0.2;
    o.eta = 0.0002;
    o.dmin_m = 0.008;
    o.barrier_gain = 12;
    o.kc = 1;
    o.limit_weight = 100;
  }
  if (method == Method::gyro_paper) {
    o.gain_form = scene::GainForm::F3;
    o.kobs = is_planar(cell) ? 2 : 0.25;
    o.mapping = scene::Mapping::paper;
    o.pairs = scene::PairPolicy::nearest;
    o.relative_velocity = false;
  }
  return o;
}

}  // namespace hamel::client
