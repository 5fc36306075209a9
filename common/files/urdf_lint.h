#pragma once
/// The rules of a URDF file, read from its text: liburdfdom stops at the first error and passes some over in
/// silence.

#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::files {

/// What is wrong with a file, what is odd about it, and what liburdfdom does not read.
struct UrdfLint {
  Problems problems;  ///< `where` is "name:line: link L" or "name:line: joint J"
  std::vector<std::string> warnings;
  std::map<std::string, double>
      acceleration;  ///< by joint, from `acceleration` or `drake:acceleration` of <limit>
};

/// Every violated rule of `text`: numbers, inertias, joint kinds, limits, axes, shapes; then, where links and
/// joints could be read, the structure: one root, no loop, one moving branch, no moving link without inertia,
/// and the end effector `tip` (empty: any) behind the last moving joint.
UrdfLint lint_urdf(const std::string& text, const std::string& name, const std::string& tip);

}  // namespace hamel::files
