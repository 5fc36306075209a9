#pragma once
/// Which links of an arm are watched lest they touch each other.

#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/scene/scene.h"

namespace hamel::scene {

/// What self_links() found.
struct SelfLinks {
  std::vector<std::pair<int, int>> watched;   ///< nearer to the base first; -1: the base
  std::vector<std::pair<int, int>> touching;  ///< left out because they touch almost everywhere
};

/// All pairs of links with shapes but: neighbours at a joint, those in `allowed`, and those that touch in 95
/// % or more of 500 configurations drawn within the joint limits (the same ones each time): their shapes
/// overlap by design.  For start-up: some milliseconds.
SelfLinks self_links(const Robot& robot, const std::vector<std::pair<int, int>>& allowed = {});

/// Sets robot.self_pairs to the shapes of these links, the one nearer to the base first.
void watch(Robot& robot, const std::vector<std::pair<int, int>>& links);

}  // namespace hamel::scene
