#include "clients/hamel/bench_drawing.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "clients/hamel/judge.h"
#include "common/rbd/rbd.h"

namespace hamel::client {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep_s = 2e-3;
constexpr double kStops_Nm = 500;  // hard stops at joint limits, for methods that know none
// Between two links of a start or goal: more than the planner keeps (dmin_m), and less than the 18 mm some of
// the Panda's links are apart however it stands.
constexpr double kSelfClear_m = 0.01;
constexpr int kMostTries = 10000;

bool is_crowded(const Cell& cell) { return cell.family == "panda_crowd"; }

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
constexpr Workshop kCrowd{0.25, 0.80, 0.01, 0.03, 0.05, 0.02, 0.3, 0.22, 12};

/// Draws until start, goal and obstacles fit together.
class Drawing {
 public:
  Drawing(const Cell& cell, const scene::Robot& robot, std::uint64_t seed)
      : cell_(cell),
        robot_(robot),
        shop_(is_planar(cell)    ? kPlanar
              : is_crowded(cell) ? kCrowd
                                 : kPanda),
        dice_(seed),
        judge_(robot_),
        ws_(robot_.chain),
        scene_(empty_scene(robot_)) {
    shoulder_ = robot_.chain.X_WB0() * robot_.chain.joint(0).X_PJ.p;
  }

  Checked<scene::Scene> draw(const std::function<bool()>& stop) {
    scene_.duration_s = shop_.duration_s;
    for (int tries = 0; tries < kMostTries; ++tries) {
      if (stop && stop()) return Problems{{cell_.family, "interrupted while a scene was drawn"}};
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
    return Problems{{fmt::format("{} {}", cell_.family, cell_.spheres),
                     fmt::format("no start, goal and spheres fit together in {} tries", kMostTries)}};
  }

 private:
  // The floor of a real cell is not modelled, but nothing is asked for below it.
  bool free_of_itself(const VectorXd& q) {
    if (judge_.self_clearance(q) <= kSelfClear_m) return false;
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

}  // namespace

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

Checked<scene::Scene> draw_random(const Cell& cell, const scene::Robot& robot, std::uint64_t seed,
                                  const std::function<bool()>& stop) {
  return Drawing(cell, robot, seed).draw(stop);
}

}  // namespace hamel::client
