#pragma once
/// From the text format's messages to the plain structs of common/scene.

#include "common/base/result.h"
#include "common/files/urdf.h"
#include "common/scene/scene.h"

namespace hamel::text {
class Planner;
class Scene;
}  // namespace hamel::text

namespace hamel::files {

/// All of a scene but its robot; `missing` tells what is absent or has the wrong length, by path.
struct SceneParts {
  std::string name;
  std::uint32_t arm = 1;
  RobotPlace place;
  std::optional<bool> self_collision;
  std::vector<std::pair<std::string, std::string>> allowed_contacts;
  std::optional<Eigen::VectorXd> q0, qd0;
  std::optional<scene::Goal> goal;
  bool steered = true;
  scene::DynamicsOptions dynamics;
  scene::PlannerOptions planner;
  scene::PerceptionOptions perception;
  scene::Buses bus;
  bool stream_start_given = false;
  double duration_s = 10;
  scene::StopRule stop = scene::StopRule::when_reached;
  scene::ReduceOptions reduce;
  scene::Accuracy accuracy;
  std::vector<scene::Lock> locked;
  Problems missing;
};

SceneParts to_parts(const text::Scene& message);
/// What `message` says goes over what `options` hold; returns what is wrong with it.
Problems to_options(const text::Planner& message, scene::PlannerOptions& options);

}  // namespace hamel::files
