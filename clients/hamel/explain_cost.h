#pragma once
/// What a step of a scene costs, reduced in one way or another.

#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/choose.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// Wall time of a step, ticks alone, and how far the joints went from those of full fidelity.
struct StepCost {
  double dynamics_us = 0, planner_us = 0;
  double joint_error = 0;  ///< largest |q - q of full fidelity| in the time that was run [rad or m]
  double total_us() const { return dynamics_us + planner_us; }
};

struct ReductionCost {
  std::string name;
  StepCost without;  ///< the scene with this reduction forbidden
};

struct Explained {
  scene::Scene written, full, reduced;
  StepCost full_cost, reduced_cost;
  std::vector<ReductionCost> each;
  std::optional<Choosing> choosing;  ///< where the scene leaves tier and step to us
};

/// Reduces `written` in every way and runs each for about `seconds` of wall time, in turns.
Explained explain_scene(const scene::Scene& written, double seconds, const trade::Watch& watch);

}  // namespace hamel::client
