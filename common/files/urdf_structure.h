#pragma once
/// Which links hang on which: is a URDF one open chain?

#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::files {

struct UrdfLink {
  bool heavy = false;  ///< has mass or inertia
  int line = 0;
};

struct UrdfJoint {
  std::string name, parent, child;
  bool moves = false;
  int line = 0;
};

struct UrdfStructure {
  std::map<std::string, UrdfLink> links;
  std::vector<UrdfJoint> joints;
};

/// Links that do not exist, two parents, several roots or none, several moving branches, no moving joint, a
/// moving link without inertia, an end effector that is not fixed to the last moving link.
Problems check_structure(const UrdfStructure& s, const std::string& file, const std::string& tip);

}  // namespace hamel::files
