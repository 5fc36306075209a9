#pragma once
/// Random scenes that have something to leave out.

#include <stdexcept>
#include <string>

#include "common/scene/scene.h"
#include "tests/support/planner_scene.h"

namespace hamel::test {

/// An obstacle of any shape somewhere within `far`, standing, drifting or swinging.
inline scene::ScriptedObstacle random_obstacle(Random& rng, std::uint32_t id, double far, bool moving) {
  using geometry::ShapeKind;
  scene::ScriptedObstacle o;
  o.at_start.id = id;
  o.at_start.X_WO = rng.pose(far);
  const int kind = static_cast<int>(rng.uniform(0, 4));
  const Eigen::Vector3d d(rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.3));
  o.at_start.shape = {kind == 0   ? ShapeKind::box
                      : kind == 1 ? ShapeKind::capsule
                      : kind == 2 ? ShapeKind::cylinder
                                  : ShapeKind::sphere,
                      d};
  if (moving && rng.coin(0.3)) o.velocity_mps = rng.vec3(0.3);
  if (moving && o.velocity_mps.isZero(0) && rng.coin(0.3)) {
    o.amplitude_m = rng.vec3(0.3);
    o.frequency_hz = rng.uniform(0.1, 1);
  }
  if (rng.coin(0.1)) o.at_start.sigma_m = rng.uniform(0, 0.01);
  return o;
}

/// A capsule about a link, within its reach.
inline scene::LinkShape random_capsule(Random& rng, int link) {
  return link_capsule(link, rng.vec3(0.2), rng.vec3(0.2), rng.uniform(0.01, 0.05));
}

/// A box or a cylinder about a link, and one at the base.
inline void clothe(scene::Robot& robot, Random& rng) {
  for (int link = -1; link < robot.chain.n(); ++link) {
    const Eigen::Vector3d d(rng.uniform(0.02, 0.15), rng.uniform(0.02, 0.15), rng.uniform(0.02, 0.15));
    const auto kind = rng.coin(0.5) ? geometry::ShapeKind::box : geometry::ShapeKind::cylinder;
    robot.shapes.push_back({link, {kind, d}, rng.pose(0.15)});
  }
  for (std::size_t b = 0; b < robot.shapes.size(); ++b)
    for (std::size_t a = 0; a < robot.shapes.size(); ++a)
      if (robot.shapes[a].link < robot.shapes[b].link - 1 && rng.coin(0.5))
        robot.self_pairs.emplace_back(a, b);
}

/// A steered arm of 2 to 7 joints among up to 40 obstacles, some of them far; `planar`: on a plane, sometimes
/// with gravity across it; sometimes with joints that are locked.
inline scene::Scene random_scene(Random& rng, bool planar, double locked) {
  const int n = 2 + static_cast<int>(rng.uniform(0, 6));
  const RandomChain how{.prismatic = 0.2, .armature = 0.3, .damping = 0.5, .mass_spread = 0.3};
  model::ChainSpec spec = planar ? random_planar_spec(rng, n, how) : random_spec(rng, n, how);
  if (planar && rng.coin(0.5)) spec.gravity_W_mps2 = 9.81 * spec.X_WB0.R.col(2);
  Eigen::VectorXd q0 = rng.vector(n, 0.5);
  std::vector<scene::Lock> locks;
  for (int i = 0; i < n; ++i) {
    model::Joint& joint = spec.joints[static_cast<std::size_t>(i)];
    joint.name = std::string("j").append(std::to_string(i));
    if (joint.kind == model::JointKind::prismatic) joint.limits.lower = -0.6, joint.limits.upper = 0.6;
    if (i == 0 || !rng.coin(locked)) continue;
    if (rng.coin(0.5))
      locks.push_back({joint.name, {}});
    else
      joint.limits.lower = joint.limits.upper = q0[i];
  }
  scene::Robot robot{"random", "", checked(std::move(spec)), {}};
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 2; ++k) robot.shapes.push_back(random_capsule(rng, i));
  scene::Scene s{.name = "random",
                 .text = "",
                 .robot = std::move(robot),
                 .q0 = q0,
                 .qd0 = Eigen::VectorXd::Zero(n),
                 .goal = scene::Goal{},
                 .dynamics = {.dt_s = 2e-3},
                 .planner = {.vmax_mps = 0.5, .amax = 20, .rho0_m = 0.2},
                 .perception = {},
                 .bus = {},
                 .duration_s = 0.4};
  s.goal->id = 1;
  s.goal->X_WG.p = s.robot.chain.X_WB0().p + rng.vec3(0.7);
  s.locked = locks;
  const auto obstacles = static_cast<std::uint32_t>(rng.uniform(0, 40));
  for (std::uint32_t id = 1; id <= obstacles; ++id) {
    s.perception.obstacles.push_back(random_obstacle(rng, id, rng.coin(0.5) ? 3 : 20, true));
    s.perception.obstacles.back().at_start.X_WO.p += s.robot.chain.X_WB0().p;
  }
  return s;
}

/// What reduce() says of one reduction.
inline const scene::Reduction& find(const scene::Scene& s, const std::string& name) {
  for (const scene::Reduction& r : s.reductions)
    if (r.name == name) return r;
  throw std::out_of_range(name);
}

}  // namespace hamel::test
