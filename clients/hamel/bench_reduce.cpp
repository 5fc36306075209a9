#include "clients/hamel/bench_reduce.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "clients/hamel/bench_drawing.h"
#include "clients/hamel/explain_cost.h"
#include "clients/hamel/shipped.h"
#include "clients/hamel/ticks.h"
#include "clients/hamel/timing.h"
#include "common/files/scene_text.h"
#include "common/geometry/solid.h"
#include "common/rbd/rbd.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/scene/reduce.h"

namespace hamel::client {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kCycles = 2000, kRounds = 5;
// What was promised.
constexpr double kThousandOfTen = 1.5, kFastestOfFull = 0.6;
constexpr double kMedian16_us = 20, kP99Of16_us = 100, kMedian256_us = 200;

/// Distance of a sphere from the arm at its start.
double room_m(const scene::Scene& s, const Eigen::Vector3d& p, double radius_m) {
  rbd::Workspace ws(s.robot.chain);
  rbd::positions(s.robot.chain, s.q0, ws);
  const auto ball = geometry::solid({geometry::ShapeKind::sphere, {radius_m, 0, 0}}, {{}, p});
  double least_m = scene::kInf;
  for (const scene::LinkShape& l : s.robot.shapes) {
    const lie::Pose X_WB = l.link < 0 ? s.robot.chain.X_WB0() : ws.X_WB[static_cast<std::size_t>(l.link)];
    least_m = std::min(least_m, geometry::closest(geometry::solid(l.shape, X_WB * l.X_LS), ball).distance_m);
  }
  return least_m;
}

/// Puts `count` spheres so far from the shoulder, 5 cm clear of the arm.
void add_spheres(scene::Scene& s, Dice& dice, int count, double radius_m, double near_m, double far_m) {
  const Eigen::Vector3d shoulder = s.robot.chain.X_WB0() * s.robot.chain.joint(0).X_PJ.p;
  const std::size_t until = s.perception.obstacles.size() + static_cast<std::size_t>(count);
  while (s.perception.obstacles.size() < until) {
    scene::ScriptedObstacle o;
    o.at_start.id = static_cast<std::uint32_t>(s.perception.obstacles.size() + 1);
    o.at_start.shape = {geometry::ShapeKind::sphere, {radius_m, 0, 0}};
    o.at_start.X_WO.p = shoulder + dice.uniform(near_m, far_m) * dice.direction();
    if (room_m(s, o.at_start.X_WO.p, radius_m) > 0.05) s.perception.obstacles.push_back(o);
  }
}

/// panda_reach without its obstacles, from its start to its end whatever is reached.
scene::Scene emptied(scene::Scene s) {
  s.perception.obstacles.clear();
  s.stop = scene::StopRule::at_duration;
  return s;
}

scene::Scene as(scene::Scene s, scene::Fidelity fidelity) {
  s.reduce = {.fidelity = fidelity};
  scene::reduce(s);
  return s;
}

/// CPU time of each of the first cycles [us].
std::vector<double> cycles_us(const scene::Scene& s, const trade::Watch& watch) {
  Ticks ticks(s);
  std::vector<double> out;
  for (int k = 0; k < kCycles; ++k) {
    const double began = watch.now_s();
    ticks.plan();
    out.push_back(1e6 * (watch.now_s() - began));
    if (!ticks.step()) break;
  }
  return out;
}

double mean(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x;
  return sum / static_cast<double>(v.size());
}

/// Mean cycle among 1,000 obstacles, over that among the ten of them that are in reach.
Json thousand(const scene::Scene& reach, bool moving, const trade::Watch& watch) {
  Dice dice(1);
  scene::Scene ten = emptied(reach);
  add_spheres(ten, dice, 10, 0.05, 0.7, 0.9);
  if (moving) ten.perception.obstacles.front().velocity_mps = {0, 0, 0.01};
  scene::Scene all = ten;
  add_spheres(all, dice, 990, 0.05, 2.5, 8);
  const scene::Scene a = as(ten, scene::Fidelity::exact), b = as(all, scene::Fidelity::exact);
  double ten_us = scene::kInf, all_us = scene::kInf;
  for (int k = 0; k < kRounds; ++k) {
    ten_us = std::min(ten_us, mean(cycles_us(a, watch)));
    all_us = std::min(all_us, mean(cycles_us(b, watch)));
  }
  return {{"moving", moving}, {"ten_us", ten_us}, {"thousand_us", all_us}, {"ratio", all_us / ten_us}};
}

/// The cycle at full fidelity beside so many spheres within reach.
Json cycle(const scene::Scene& reach, int spheres, const trade::Watch& watch) {
  Dice dice(1);
  scene::Scene s = emptied(reach);
  add_spheres(s, dice, spheres, spheres > 16 ? 0.03 : 0.06, 0.3, 0.9);
  s = as(s, scene::Fidelity::full);
  std::vector<double> us;
  for (int k = 0; k < kRounds; ++k)
    for (const double x : cycles_us(s, watch)) us.push_back(x);
  return {{"spheres", spheres}, {"p50_us", quantile(us, 0.5)}, {"p99_us", quantile(us, 0.99)}};
}

/// A step of panda_reach, over full fidelity and over the same time of the run.
Json reduced(scene::Scene reach, scene::Fidelity fidelity, const trade::Watch& watch) {
  reach.reduce = {.fidelity = fidelity};
  const Explained e = explain_scene(reach, 0.5, watch);
  return {{"fidelity", scene::to_string(fidelity)},
          {"step_us", e.reduced_cost.total_us()},
          {"dt_s", e.reduced_cost.dt_s},
          {"of_full", e.reduced_cost.of(e.full_cost)}};
}

void print(const Json& all) {
  const auto number = [](const Json& r, const char* key) { return r[key].get<double>(); };
  for (const Json& r : all["thousand"])
    fmt::print(
        "a cycle among 1,000 obstacles of which 10 are in reach{}: {:.1f} us, {:.2f} times that among the "
        "10\n",
        r["moving"].get<bool>() ? ", one moving" : "", number(r, "thousand_us"), number(r, "ratio"));
  for (const Json& r : all["cycle"])
    fmt::print("a cycle at full fidelity beside {} spheres: {:.1f} us (median), 99 of 100 within {:.1f} us\n",
               r["spheres"].get<int>(), number(r, "p50_us"), number(r, "p99_us"));
  for (const Json& r : all["panda_reach"])
    fmt::print("panda_reach, {}: {:.2f} us a step of {:g} ms, {:.2f} of full fidelity\n",
               r["fidelity"].get<std::string>(), number(r, "step_us"), 1e3 * number(r, "dt_s"),
               number(r, "of_full"));
}

bool kept(const Json& all) {
  bool good = all["panda_reach"][1]["of_full"] <= kFastestOfFull;
  for (const Json& r : all["thousand"]) good &= r["ratio"] <= kThousandOfTen;
  good &= all["cycle"][0]["p50_us"] <= kMedian16_us && all["cycle"][0]["p99_us"] <= kP99Of16_us;
  return good && all["cycle"][1]["p50_us"] <= kMedian256_us;
}

}  // namespace

int bench_reduce(const BenchReduceArgs& args) {
  runtime::start_log("hamel", false);
  const std::string path = shipped_scene("panda_reach");
  if (path.empty()) return runtime::complain("hamel bench reduce", {{"panda_reach", "is not installed"}});
  const auto reach = files::read_scene(path);
  if (!reach) return runtime::complain("hamel bench reduce", reach.error());
  const trade::Watch watch = steady_watch();
  Json all;
  for (const bool moving : {false, true}) all["thousand"].push_back(thousand(reach.value(), moving, watch));
  for (const int spheres : {16, 256}) all["cycle"].push_back(cycle(reach.value(), spheres, watch));
  for (const scene::Fidelity f : {scene::Fidelity::exact, scene::Fidelity::fastest})
    all["panda_reach"].push_back(reduced(reach.value(), f, watch));
  if (args.json)
    fmt::print("{}\n", all.dump(1));
  else
    print(all);
  return !args.check || kept(all) ? runtime::kDone : runtime::kFailed;
}

}  // namespace hamel::client
