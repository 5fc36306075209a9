#pragma once
/// What a sensor does to the truth: noise, missing obstacles, a limited field of view.

#include <cstdint>
#include <vector>

#include "common/geometry/shape.h"
#include "common/scene/scene.h"

namespace hamel::perception {

/// Takes away what set number `set` does not show and moves the rest by noise; the standard deviation is
/// added to sigma_m.  What happens to an obstacle follows from the seed, the number of the set and its id
/// alone.
void apply(const scene::Flaws& flaws, std::uint64_t set, std::vector<geometry::Obstacle>& obstacles);

}  // namespace hamel::perception
