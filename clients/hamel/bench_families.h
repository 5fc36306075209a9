#pragma once
/// The random scenes of `hamel bench planner`, and the settings each method is run with there.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// Which model of the arm is steered.
enum class ArmModel : std::uint8_t {
  prototype,  ///< no gravity, no torque limits, links may pass through each other
  full        ///< gravity, torque limits, self-collision
};

/// A cell of the table: scenes drawn alike.
struct Cell {
  std::string family;  ///< planar_static, planar_moving, panda_static, panda_moving, example_5_2
  int spheres = 1;
  std::string variant;  ///< example_5_2: "damping 0.5, vmax 1"; else empty
};

/// All families, or the named ones; `spheres` keeps cells with these numbers only (empty: all).  A problem
/// for a name that is none.
Checked<std::vector<Cell>> cells(const std::vector<std::string>& families, const std::vector<int>& spheres);

/// The arms of the families; made once.
struct BenchRobots {
  scene::Robot planar, panda;
  std::vector<std::pair<int, int>> panda_self_pairs;
};
/// Four links of 1 m, slender rods of 1 kg, capsules of 5 cm; the Panda of deploy/robots.
Checked<BenchRobots> bench_robots(ArmModel model);

/// Scene `index` of a cell, without the planner's settings.  The same (cell, seed, index) gives the same
/// scene, whatever else is run.
///
/// Start and goal are random configurations whose clearance is at least 5 cm and 2 cm (planar 10 cm, 3 cm);
/// the goal is the end effector's place there, at least 0.3 m (1 m) from the start.  That a way exists
/// between them is not proved. Moving spheres go straight on with 0.1 to 1 m/s; each passes a random place of
/// the workspace within the first half of the run, none comes near the base, and none touches the start
/// within half a second.
scene::Scene draw_scene(const Cell& cell, const BenchRobots& robots, ArmModel model, std::uint64_t seed,
                        std::size_t index);

/// The settings of `method` in a cell: those of the design's tables; `gyro` is the default.
scene::PlannerOptions settings(const Cell& cell, scene::Method method);

}  // namespace hamel::client
