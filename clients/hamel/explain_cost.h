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
  double dt_s = 0;
  /// Largest |q - q of full fidelity| at the times that both have, in the time that was run [rad or m]; NaN
  /// where nothing was compared: another number of joints, or no such time.
  double joint_error = 0;
  double total_us() const { return dynamics_us + planner_us; }
  /// Over the same time of the run.
  double of(const StepCost& other) const { return total_us() / dt_s / (other.total_us() / other.dt_s); }
};

/// Obstacles in the fullest set of the run, standing, moving and streamed, and how many the planner is handed
/// of a set at most, the arm being at its start.
struct ObstacleCount {
  std::size_t before = 0, after = 0;
};

struct ReductionCost {
  std::string name;
  StepCost without;  ///< the scene with this reduction forbidden, the others and the chosen step in force
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
  scene::Scene written, full;
  scene::Scene reduced;  ///< with the chosen tier and step, if any
  StepCost full_cost, reduced_cost;
  ObstacleCount obstacles;
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
