// Example 5.2: moved about at random, and over a grid of settings.
#include <Eigen/Geometry>
#include <array>
#include <numbers>

#include "clients/hamel/bench_drawing.h"
#include "clients/hamel/judge.h"

namespace hamel::client {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kRadius_m = 0.05;  // of a link, where things are moved about
constexpr double kDuration_s = 20, kGridDuration_s = 30;

}  // namespace

scene::Scene draw_example_5_2(const scene::Robot& robot, std::uint64_t seed) {
  Dice dice(seed);
  Judge judge(robot);
  scene::Scene s = empty_scene(robot);
  s.duration_s = kDuration_s;
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
    if (room > kRadius_m + 0.05 && s.goal->X_WG.p.norm() < 3.9 && judge.clearance(s.q0, one) > 0.05) break;
  }
  s.perception.obstacles = {o};
  return s;
}

scene::Robot planar_arm(const Vector3d& inertia_kgm2, double radius_m) {
  model::ChainSpec spec;
  spec.name = "planar_4";
  spec.gravity_W_mps2.setZero();
  std::vector<scene::LinkShape> shapes;
  for (int i = 0; i < 4; ++i) {
    model::Joint joint;
    joint.name = "joint" + std::to_string(i + 1);
    if (i > 0) joint.X_PJ.p = Vector3d::UnitX();
    spec.joints.push_back(joint);
    spec.links.push_back({"link" + std::to_string(i + 1), {1, {0.5, 0, 0}, inertia_kgm2.asDiagonal()}});
    scene::LinkShape shape;
    shape.link = i;
    shape.shape = {geometry::ShapeKind::capsule, {radius_m, 1, 0}};
    shape.X_LS.p = {0.5, 0, 0};
    shape.X_LS.R = Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitY()).toRotationMatrix();
    shapes.push_back(shape);
  }
  spec.X_NE.p = Vector3d::UnitX();
  spec.tip_name = "tip";
  return {"planar_4", "", model::build(std::move(spec)).value(), std::move(shapes), {}};
}

GridPoint grid_point(std::size_t index) noexcept {
  const auto pick = [&index]<std::size_t n>(const std::array<double, n>& of) {
    const double v = of[index % n];
    index /= n;
    return v;
  };
  GridPoint g;
  g.q0_rad = pick(std::array{0.0, 0.05});
  g.rods = pick(std::array{0.0, 1.0}) > 0;
  g.dt_s = pick(std::array{1e-3, 1e-2});
  g.damping = pick(std::array{0.5, 2.0});
  g.zeta = pick(std::array{0.5, 1.0, 2.0});
  g.kp = pick(std::array{2.0, 4.0, 10.0, 25.0});
  return g;
}

scene::Scene draw_grid_point(std::size_t index) {
  const GridPoint g = grid_point(index);
  scene::Scene s = empty_scene(planar_arm(g.rods ? kRod_kgm2 : Vector3d(1, 1, 1), 0));
  s.duration_s = kGridDuration_s;
  s.dynamics.dt_s = g.dt_s;
  s.q0.setConstant(4, g.q0_rad);
  scene::ScriptedObstacle o;
  o.at_start.id = 1;
  o.at_start.shape = {geometry::ShapeKind::sphere, {0.25, 0, 0}};
  o.at_start.X_WO.p = {2.4, 2.2, 0};
  s.perception.obstacles = {o};
  s.goal->X_WG.p = {2, 3, 0};
  return s;
}

}  // namespace hamel::client
