#pragma once
/// Names of tiers for messages of tests that need nothing else of the scene's options.

#include "services/dynamics/core/integrator.h"

namespace hamel::test {

inline const char* name(dynamics::Tier tier) {
  constexpr const char* kNames[] = {"hamel", "midpoint", "gauss", "semi_implicit_euler", "rk4", "dopri8"};
  return kNames[static_cast<int>(tier)];
}

}  // namespace hamel::test
