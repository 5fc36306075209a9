#pragma once
/// MoveIt's planning problems as scenes: import only.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// The problems of one folder of a set.
struct ProblemSet {
  std::string name;  ///< of the folder
  std::vector<scene::Scene> scenes;
};

/// Every sceneNNNN.yaml with its requestNNNN.yaml below `folder`, in the order of their names.
///
/// Boxes, spheres and cylinders [height, radius] with their poses (quaternions x y z w) become static
/// obstacles.  The start and the goal are joint values by name; the goal becomes the pose of the end effector
/// there.  A goal that grasps an object has it between the fingers, where the hand's capsules touch it: the
/// pose is then drawn back along the tool's z axis, in steps of 1 cm and 20 cm at most, until the last link
/// has 2 cm of room; where it never has, the pose stays as it is written.  Joints the robot has not (fingers)
/// are passed over; one it has and the file does not name is a problem, and so is anything but primitives.
Checked<std::vector<ProblemSet>> load_problems(const std::string& folder, const scene::Robot& robot);

}  // namespace hamel::client
