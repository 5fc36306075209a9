#pragma once
/// Collision shapes of URDF links, and the sidecar that gives spheres for meshes.

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/scene/scene.h"

namespace hamel::files {

struct SidecarSphere {
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();
  double radius_m = 0;
};

/// Spheres by link name.
using Sidecar = std::map<std::string, std::vector<SidecarSphere>>;

/// The spheres of a sidecar's text, or every problem as "name:line:column".
Checked<Sidecar> parse_sidecar(const std::string& text, const std::string& name);

/// Appends the shapes of `link`, whose frame stands at X_NL in the frame of chain link `carrier` (-1: the
/// base). A link of meshes alone with no spheres in the sidecar becomes a capsule from
/// its joint to the next, as thick as its inertia says, with a warning.
void append_shapes(const urdf::Link& link, int carrier, const lie::Pose& X_NL, const Sidecar& sidecar,
                   std::vector<scene::LinkShape>& shapes, std::vector<std::string>& warnings);

lie::Pose to_pose(const urdf::Pose& pose);

}  // namespace hamel::files
