#pragma once
/// Robots as files: URDF, the serial subset.

#include <Eigen/Core>
#include <string>

#include "common/base/result.h"
#include "common/lie/se3.h"
#include "common/scene/scene.h"

namespace hamel::files {

/// What a URDF file does not say.
struct RobotPlace {
  std::string tip;  ///< end-effector link; empty: see load_urdf
  lie::Pose X_WB0;  ///< pose of the root link in the world
  Eigen::Vector3d gravity_W_mps2 = {0, 0, -9.81};
};

/// The robot in a URDF file, read through liburdfdom, or every problem with "path:line" and the link or
/// joint.
///
/// Joints: revolute, continuous, prismatic, fixed; anything else, mimic and branches that move are refused by
/// name. Links behind fixed joints are lumped into the moving link that carries them; the inertial origin's
/// rotation is applied.  Mass 0 with inertia 0 counts as none given.  A link whose mass is 0 but whose
/// inertia is positive definite is lumped with a warning.  A limit whose four numbers are all 0 counts as
/// none given, with a warning.
///
/// The end effector is `tip`, a link fixed to the last moving one; when empty, the end of the chain of fixed
/// joints behind the last moving link, or that link itself where several branches hang on it.
///
/// Shapes: sphere, box, cylinder; a cylinder with a sphere of its radius at each end is one capsule, and a
/// cylinder of radius 0 is a segment.  Meshes are not read: where a link has nothing else, a capsule from its
/// joint to the next, as thick as its inertia says, stands for it with a warning, unless
/// NAME.spheres.textproto beside NAME.urdf gives spheres for it:  link { name: "hand" spheres { center_m: [0,
/// 0, 0.05] radius_m: 0.06 } }
Checked<scene::Robot> load_urdf(const std::string& path, const RobotPlace& place = {});

/// The same from text; `name` stands for the path in problems, `spheres` is the sidecar's text, empty: none.
Checked<scene::Robot> parse_urdf(const std::string& text, const std::string& name,
                                 const RobotPlace& place = {}, const std::string& spheres = {});

/// Rotation by roll, pitch, yaw about the fixed axes x, y, z: Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Matrix3d rotation_from_rpy(const Eigen::Vector3d& rpy_rad);

}  // namespace hamel::files
