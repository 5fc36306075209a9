#include "clients/hamel/problems.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "common/geometry/solid.h"
#include "common/rbd/rbd.h"
#include "services/planner/core/reachable.h"

namespace hamel::client {

namespace {

namespace fs = std::filesystem;

constexpr double kGoalClear_m = 0.02, kBack_m = 0.01, kMostBack_m = 0.2;

std::vector<double> numbers(const YAML::Node& node, std::size_t count) {
  auto v = node.as<std::vector<double>>();
  if (v.size() != count)
    throw YAML::Exception(node.Mark(), "must have " + std::to_string(count) + " numbers");
  return v;
}

lie::Pose pose(const YAML::Node& node) {
  const auto p = numbers(node["position"], 3), r = numbers(node["orientation"], 4);
  lie::Pose X;
  X.p = {p[0], p[1], p[2]};
  X.R = Eigen::Quaterniond(r[3], r[0], r[1], r[2]).normalized().toRotationMatrix();
  return X;
}

geometry::Shape shape(const YAML::Node& node) {
  using geometry::ShapeKind;
  const auto type = node["type"].as<std::string>();
  const YAML::Node d = node["dimensions"];
  if (type == "box") {
    const auto v = numbers(d, 3);
    return {ShapeKind::box, {v[0], v[1], v[2]}};
  }
  if (type == "cylinder") {
    const auto v = numbers(d, 2);
    return {ShapeKind::cylinder, {v[1], v[0], 0}};
  }
  if (type == "sphere") return {ShapeKind::sphere, {numbers(d, 1)[0], 0, 0}};
  throw YAML::Exception(node.Mark(), "primitive " + type + " is not known");
}

void read_objects(const YAML::Node& root, scene::Scene& s) {
  for (const YAML::Node& object : root["world"]["collision_objects"]) {
    if (object["meshes"] && object["meshes"].size() > 0)
      throw YAML::Exception(object.Mark(), "meshes are not read");
    const lie::Pose X_WB = object["pose"] ? pose(object["pose"]) : lie::Pose{};
    const YAML::Node shapes = object["primitives"], poses = object["primitive_poses"];
    if (shapes.size() != poses.size()) throw YAML::Exception(object.Mark(), "has not one pose a primitive");
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      scene::ScriptedObstacle o;
      o.at_start.id = static_cast<std::uint32_t>(s.perception.obstacles.size() + 1);
      o.at_start.shape = shape(shapes[k]);
      o.at_start.X_WO = X_WB * pose(poses[k]);
      s.perception.obstacles.push_back(o);
    }
  }
}

Eigen::VectorXd joints(const std::map<std::string, double>& named, const model::Chain& chain,
                       const YAML::Mark& where) {
  Eigen::VectorXd q(chain.n());
  for (int i = 0; i < chain.n(); ++i) {
    const auto at = named.find(chain.joint(i).name);
    if (at == named.end()) throw YAML::Exception(where, "does not name joint " + chain.joint(i).name);
    q[i] = std::clamp(at->second, chain.joint(i).limits.lower, chain.joint(i).limits.upper);
  }
  return q;
}

// The end effector's pose at q, drawn back along its z axis until its link is clear.
lie::Pose before_grasp(const scene::Robot& robot, const scene::Scene& s, const Eigen::VectorXd& q) {
  rbd::Workspace ws(robot.chain);
  rbd::positions(robot.chain, q, ws);
  const lie::Pose X_WE = rbd::tip(robot.chain, ws);
  for (double back_m = 0; back_m < kMostBack_m; back_m += kBack_m) {
    const Eigen::Vector3d back_W = -back_m * X_WE.R.col(2);
    double room_m = kGoalClear_m;
    for (const scene::LinkShape& l : robot.shapes) {
      if (l.link != robot.chain.n() - 1) continue;
      lie::Pose X_WS = ws.X_WB.back() * l.X_LS;
      X_WS.p += back_W;
      for (const scene::ScriptedObstacle& o : s.perception.obstacles) {
        const auto other = geometry::solid(o.at_start.shape, o.at_start.X_WO);
        room_m = std::min(room_m, geometry::closest(geometry::solid(l.shape, X_WS), other).distance_m);
      }
    }
    scene::Goal goal;
    goal.kind = scene::GoalKind::pose;
    goal.X_WG = {X_WE.R, X_WE.p + back_W};
    if (room_m >= kGoalClear_m && planner::reachability(robot.chain, {goal}, {}).reachable) return goal.X_WG;
  }
  return X_WE;
}

void read_request(const YAML::Node& root, const scene::Robot& robot, scene::Scene& s) {
  const YAML::Node start = root["start_state"]["joint_state"];
  const auto names = start["name"].as<std::vector<std::string>>();
  const auto values = numbers(start["position"], names.size());
  std::map<std::string, double> named;
  for (std::size_t k = 0; k < names.size(); ++k) named[names[k]] = values[k];
  s.q0 = joints(named, robot.chain, start.Mark());
  const YAML::Node goals = root["goal_constraints"];
  if (goals.size() != 1) throw YAML::Exception(root.Mark(), "must have one goal");
  named.clear();
  for (const YAML::Node& c : goals[0]["joint_constraints"])
    named[c["joint_name"].as<std::string>()] = c["position"].as<double>();
  s.goal = scene::Goal{};
  s.goal->id = 1;
  s.goal->kind = scene::GoalKind::pose;
  s.goal->X_WG = before_grasp(robot, s, joints(named, robot.chain, goals.Mark()));
}

/// One problem; what is wrong with it goes to `found`.
std::optional<scene::Scene> load(const fs::path& file, const fs::path& request, const scene::Robot& robot,
                                 Problems& found) {
  scene::Scene s{file.stem().string(),         "", 1, robot, {}, {}, {}, true, {}, {}, {}, {}, 20,
                 scene::StopRule::when_reached};
  s.qd0 = Eigen::VectorXd::Zero(robot.chain.n());
  fs::path at = file;
  try {
    read_objects(YAML::LoadFile(file.string()), s);
    at = request;
    read_request(YAML::LoadFile(request.string()), robot, s);
  } catch (const YAML::Exception& e) {
    found.push_back({at.string() + ":" + std::to_string(e.mark.line + 1), e.msg});
    return {};
  }
  for (const Problem& p : scene::problems(s)) found.push_back({file.string() + ": " + p.where, p.what});
  return s;
}

}  // namespace

Checked<std::vector<ProblemSet>> load_problems(const std::string& folder, const scene::Robot& robot) {
  std::map<std::string, std::vector<fs::path>> files;
  std::error_code error;
  for (const auto& entry : fs::recursive_directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("scene") && name.ends_with(".yaml"))
      files[entry.path().parent_path().filename().string()].push_back(entry.path());
  }
  if (error) return Problems{{folder, error.message()}};
  if (files.empty()) return Problems{{folder, "holds no scene*.yaml"}};
  Problems found;
  std::vector<ProblemSet> sets;
  for (auto& [name, paths] : files) {
    std::sort(paths.begin(), paths.end());
    ProblemSet& set = sets.emplace_back(ProblemSet{name, {}});
    for (const fs::path& path : paths) {
      const fs::path request = path.parent_path() / ("request" + path.filename().string().substr(5));
      if (auto s = load(path, request, robot, found)) set.scenes.push_back(std::move(*s));
    }
  }
  if (!found.empty()) return found;
  return sets;
}

}  // namespace hamel::client
