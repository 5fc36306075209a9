#pragma once
/// The random scenes of `hamel bench planner`, and the settings each method is run with there.

#include <cstdint>
#include <functional>
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

inline constexpr const char* kFamilies =
    "planar_static, planar_moving, panda_static, panda_moving, panda_crowd, example_5_2, example_5_2_grid";

/// A cell of the table: scenes drawn alike.
struct Cell {
  std::string family;  ///< one of kFamilies
  int spheres = 1;
  std::string variant;  ///< example_5_2: "damping 0.5, vmax 1"; its grid: "no vmax"; else empty
};

/// All families, or the named ones; `spheres` keeps cells with these numbers only (empty: all).  A problem
/// for a name that is none.
Checked<std::vector<Cell>> cells(const std::vector<std::string>& families, const std::vector<int>& spheres);

/// The arms of the families; made once.
struct BenchRobots {
  scene::Robot planar, panda;
};
/// Four links of 1 m, slender rods of 1 kg, capsules of 5 cm; the Panda of deploy/robots.
Checked<BenchRobots> bench_robots(ArmModel model);

/// `asked`, or what the grid has.
std::size_t scenes_of(const Cell& cell, std::size_t asked);

/// Its scenes say with which step they are run.
bool has_own_step(const Cell& cell);

/// Scene `index` of a cell, without the planner's settings.  The same (cell, seed, index) gives the same
/// scene, whatever else is run.
///
/// Start and goal are random configurations whose clearance is at least 5 cm and 2 cm (planar 10 cm, 3 cm),
/// and 1 cm between links that must not touch; the goal is the end effector's place there, at least 0.3 m
/// (1 m) from the start.  That a way exists between them is not proved. Moving spheres go straight on with
/// 0.1 to 1 m/s; each passes a random place of the workspace within the first half of the run, none comes
/// near the base, and none touches the start within half a second.  Spheres have a radius of 4 to 11 cm
/// (planar 20 to 40 cm, in a crowd 1 to 3 cm).
/// @param stop  asked at each try
/// @return a problem where nothing fits in many tries, or `stop` said so
Checked<scene::Scene> draw_scene(const Cell& cell, const BenchRobots& robots, std::uint64_t seed,
                                 std::size_t index, const std::function<bool()>& stop = {});

/// The settings of `method` in a cell: those of the design's tables; `gyro` is the default.
/// @param index  of the scene: the grid's settings differ from scene to scene
scene::PlannerOptions settings(const Cell& cell, scene::Method method, std::size_t index = 0);

}  // namespace hamel::client
