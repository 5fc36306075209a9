#pragma once
/// A run as a picture needs it: what was recorded, thinned out to as many rows as can be seen.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/geometry/shape.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// One moment; NaN: not in the file.
struct Row {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double t_s = 0;
  Eigen::VectorXd q;
  Eigen::Vector3d tip_m = Eigen::Vector3d::Constant(kNone);
  double clearance_m = kNone, error_m = kNone, energy_J = kNone, iterations = kNone;
  double planner_s = kNone;       ///< wall time of the planner's cycle
  double command_age_s = kNone;   ///< age of the state that the applied command answers
  double obstacle_age_s = kNone;  ///< age of the obstacles that the planner saw
};

struct Course {
  std::string name;
  std::optional<scene::Scene> scene;  ///< none: a CSV without --scene
  std::vector<Row> rows;  ///< thinned: smallest clearance, largest count and latency of those left out
  std::vector<std::vector<geometry::Obstacle>> obstacles;  ///< at some times of the run
};

struct CourseOptions {
  std::string path;        ///< .mcap, or what --csv wrote
  std::string scene_path;  ///< empty: the recording's
  std::vector<std::string> overrides;
  std::size_t most_rows = 1000;
};

/// Reads it; of a damaged recording what is whole.
Checked<Course> load_course(const CourseOptions& options);

}  // namespace hamel::client
