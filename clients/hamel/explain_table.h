#pragma once
/// Speed against accuracy: `hamel explain --table`.

#include <vector>

#include "clients/hamel/choose.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// "SE2" or "SE3": what the arm is computed on.
const char* space_of(const scene::Scene& s);

/// A Markdown table: full fidelity, the default, and the setting chosen for the accuracy of each scene; their
/// times taken in turns.
/// @return 0; 1 where nothing tried keeps to a scene's accuracy, or where what was chosen takes over 10 %
/// longer than another measured setting that keeps to it
int print_table(const std::vector<scene::Scene>& scenes, const trade::Watch& watch);

}  // namespace hamel::client
