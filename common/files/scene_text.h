#pragma once
/// Scenes as files: protobuf text format, schema in scene.proto, described in deploy/README.md.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/scene/scene.h"

namespace hamel::files {

/// The scene in a file after overrides such as "planner.method=gyro" or
/// "perception.obstacles[0].position_m=[1,0,0]".
///
/// @param path       of the scene file; the paths in it are relative to its folder
/// @param overrides  "field.path=value" in text format, in order; strings may be given without quotes
/// @return a scene that passes scene::problems(), or every problem: `where` is "path:line:column" (from 1,
/// tabs
///         count to the next multiple of 8) or "--set override"; those of a robot or stream name that file
/// Reads the robot's URDF and the stream's file too.  Never throws for what a file holds.
/// The scene comes reduced to what it requires (common/scene/reduce.h): a pure function of the scene, so
/// that every process that loads the same file models the same.
Checked<scene::Scene> load_scene(const std::string& path, const std::vector<std::string>& overrides = {});
/// The same scene as written.
Checked<scene::Scene> read_scene(const std::string& path, const std::vector<std::string>& overrides = {});

/// Changes planner options by assignments such as "kc=1" or "method=gyro", in order; every problem of them
/// and every rule the outcome violates.
Problems set_planner(const std::vector<std::string>& assignments, scene::PlannerOptions& options);

/// A plain robot as a scene: the free motion of the arm in a URDF file, from rest with every joint at 0.5 (or
/// at its limit nearest to that) under gravity along -z, 10 s; overrides change what they like.  Else every
/// problem.
Checked<scene::Scene> load_free_motion(const std::string& urdf_path,
                                       const std::vector<std::string>& overrides = {});

/// A whole file, or the problem that kept it from being read (absent, a folder, no permission, over 256 MB).
Checked<std::string> read_file(const std::string& path);

}  // namespace hamel::files
