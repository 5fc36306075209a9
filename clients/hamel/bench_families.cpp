#include "clients/hamel/bench_families.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/hamel/bench_drawing.h"
#include "clients/hamel/robots.h"
#include "common/base/hash.h"
#include "common/files/urdf.h"
#include "common/scene/self_links.h"

namespace hamel::client {

namespace {

using scene::Method;

constexpr double kPlanarRadius_m = 0.05;  // of a link
constexpr const char* kGrid = "example_5_2_grid";

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
  for (const char* variant : {"vmax 1", "no vmax"}) all.push_back({"example_5_2_grid", 1, variant});
  all.push_back({"panda_crowd", 256, ""});
  Problems found;
  for (const std::string& f : families)
    if (std::none_of(all.begin(), all.end(), [&](const Cell& c) { return c.family == f; }))
      found.push_back({"--family " + f, std::string("is none of ") + kFamilies});
  if (!found.empty()) return found;
  std::erase_if(all, [&](const Cell& c) {
    const bool other_family =
        !families.empty() && std::find(families.begin(), families.end(), c.family) == families.end();
    return other_family ||
           (!spheres.empty() && std::find(spheres.begin(), spheres.end(), c.spheres) == spheres.end());
  });
  if (all.empty())
    return Problems{
        {"--spheres", "leaves no cell: static ones have 1, 2, 4, 8, 16, moving ones 1, 4, 8, a crowd 256"}};
  return all;
}

Checked<BenchRobots> bench_robots(ArmModel model) {
  files::RobotPlace place;
  place.tip = "panda_tcp";
  if (model == ArmModel::prototype) place.gravity_W_mps2.setZero();
  auto panda = files::parse_urdf(std::string(panda_urdf()), "panda.urdf", place);
  if (!panda) return panda.error();
  BenchRobots robots{planar_arm(kRod_kgm2, kPlanarRadius_m), std::move(panda).value()};
  if (model == ArmModel::prototype) {
    lift_torque_limits(robots.panda);
    return robots;
  }
  scene::watch(robots.panda, scene::self_links(robots.panda).watched);
  return robots;
}

std::size_t scenes_of(const Cell& cell, std::size_t asked) {
  return cell.family == kGrid ? kGridPoints : asked;
}

bool has_own_step(const Cell& cell) { return cell.family == kGrid; }

Checked<scene::Scene> draw_scene(const Cell& cell, const BenchRobots& robots, std::uint64_t seed,
                                 std::size_t index, const std::function<bool()>& stop) {
  const std::string number = std::to_string(cell.spheres) + "/" + std::to_string(index);
  std::uint64_t h = hashed(cell.family, kHashStart ^ (seed * SplitMix64::kStep));
  h = hashed(number, h);  // variants share their scenes
  const scene::Robot& robot = is_planar(cell) ? robots.planar : robots.panda;
  Checked<scene::Scene> s = cell.family == kGrid           ? draw_grid_point(index)
                            : cell.family == "example_5_2" ? draw_example_5_2(robot, h)
                                                           : draw_random(cell, robot, h, stop);
  if (s) s.value().name = fmt::format("{}_{}_{}", cell.family, cell.spheres, index);
  return s;
}

scene::PlannerOptions settings(const Cell& cell, Method method, std::size_t index) {
  scene::PlannerOptions o;
  o.method = method;
  o.lambda2 = 1e-3;
  if (is_planar(cell)) {
    const bool example = cell.family.starts_with("example_5_2");
    o.kp = 10;
    o.kv = example ? 6.32 : 6.3;
    o.vmax_mps = cell.variant.ends_with("no vmax") ? scene::kInf : 1;
    o.damping = cell.variant.starts_with("damping 2") ? 2 : 0.5;
    o.rho0_m = example ? 0.5 : 0.4;
    o.eta = 0.02;
    if (cell.family == kGrid) {
      const GridPoint g = grid_point(index);
      o.kp = g.kp;
      o.kv = 2 * g.zeta * std::sqrt(g.kp);
      o.damping = g.damping;
    }
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
    const bool example = cell.family.starts_with("example_5_2");  // F3 reaches less there
    o.gain_form = example ? scene::GainForm::F2 : scene::GainForm::F3;
    o.kobs = example ? 1 : is_planar(cell) ? 2 : 0.25;
    o.mapping = scene::Mapping::paper;
    o.pairs = scene::PairPolicy::nearest;
    o.relative_velocity = false;
  }
  return o;
}

}  // namespace hamel::client
