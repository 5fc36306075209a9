#pragma once
/// What a step of a scene costs, reduced in one way or another.

#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/choose.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// CPU time of a step, ticks alone, and how far the joints went from those of full fidelity.
struct StepCost {
  double dynamics_us = 0, planner_us = 0;
  double joint_error = 0;  ///< largest |q - q of full fidelity| in the time that was run [rad or m]
  double total_us() const { return dynamics_us + planner_us; }
};

struct ReductionCost {
  std::string name;
  StepCost without;  ///< the scene with this reduction forbidden
};

/// A bounded reduction by itself, over the first steps of the run: by how much the distance of a link to its
/// nearest obstacle was off at most (shapes, requery, rate; merge: distances beyond rho0 count in
/// proportion), or the longest way that a point of the arm and an obstacle closed in between two cycles
/// (cycle) [m].
struct MeasuredError {
  std::string name;
  double error_m = 0;
};

struct Explained {
  scene::Scene written, full, reduced;
  StepCost full_cost, reduced_cost;
  std::vector<ReductionCost> each;
  std::vector<MeasuredError> errors;  ///< of the bounded ones in force, step apart
  std::optional<Choosing> choosing;   ///< where the scene leaves tier and step to us
};

/// Runs `reduced`, and beside it the planner of `exact` at the same states: by how much the distances that
/// the links report differ at most [m].  Of a distance d beyond `near_m` the share near_m/d counts; what
/// touches is at distance 0, and what is farther than kSeen_m, where obstacles may be seen or not, at that.
double distance_error(const scene::Scene& reduced, const scene::Scene& exact, std::uint64_t steps,
                      double near_m = scene::kInf);
/// How far any point of the arm and the fastest scripted obstacle close in at most between two planner cycles
/// that the reduction `cycle` put farther apart than as written [m].
double closed_in(const scene::Scene& reduced, std::uint64_t steps);
/// Reduces `written` in every way and runs each for about `seconds` of CPU time, in turns.
Explained explain_scene(const scene::Scene& written, double seconds, const trade::Watch& watch);

}  // namespace hamel::client
