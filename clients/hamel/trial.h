#pragma once
/// One run of a scene in this process without any bus: planner core, integrator and an independent judge.
/// Pure but for an injected clock.  Same scene, same result.

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/hamel/judge.h"
#include "common/scene/scene.h"
#include "services/planner/core/planner.h"

namespace hamel::client {

/// Durations in bins 8 % apart, from 10 ns to 1 s.
class Durations {
 public:
  void add(double s) noexcept;
  void add(const Durations& other) noexcept;
  /// Upper edge of the bin that holds this part of them [s]; NaN when empty.
  double quantile(double part) const noexcept;

 private:
  std::array<std::uint32_t, 240> bins_{};
  std::uint64_t count_ = 0;
};

enum class Ending : std::uint8_t { reached, collided, stuck, timed_out, failed };
const char* to_string(Ending v);

inline constexpr double kWatched_s = 1, kStill_radps = 0.02;

struct TrialOptions {
  /// Obstacles are known at every cycle as they are then; else only at the set times of perception.
  bool perfect_perception = true;
  bool velocities_known = true;
  double rate_hz = 0;    ///< perfect perception: only so often, at whole multiples of the period; 0: always
  double latency_s = 0;  ///< what the planner is told is at least so old, and it is told so
  /// From then on nothing new is told of the obstacles.  The trial then ends, timed_out, kWatched_s after
  /// what was told last has become stale, whether the goal is reached or not.
  double dropout_s = std::numeric_limits<double>::infinity();
  Eigen::VectorXd by_way_of = {};  ///< a configuration to pass first; empty: none
  /// Not empty: one after the other for ever, each given up after 20 s; contacts are counted and do not end
  /// the trial.  Else the scene's goal alone.
  std::vector<scene::Goal> cycle = {};
  std::function<double()> now_s = {};  ///< clock for cycle times; empty: not timed
  std::function<bool()> stop = {};     ///< asked now and then; true: the trial ends as failed
};

/// What came of the obstacle stream's end.  Stale: older than PlannerOptions::stale_brake_s.
struct Dropout {
  double speed_radps = 0;  ///< of the fastest joint when the stream ended, and when it was stale
  double stale_speed_radps = 0;
  double stop_s = 0;   ///< from stale until every joint stays slower than kStill_radps
  double least_s = 0;  ///< in which the joints' torques, less gravity, could take the momentum there was
  bool told = true;    ///< every cycle from stale on was UNSAFE stale_obstacles
};

/// How a trial went, all of it measured from the arm's states and not taken from the planner's report, but
/// for what is named so.
struct Trial {
  Ending ending = Ending::failed;
  double end_s = 0;
  double time_s = std::numeric_limits<double>::quiet_NaN();  ///< to the goal, where reached
  double path_m = 0;                                         ///< of the end effector
  double clearance_min_m = std::numeric_limits<double>::infinity();
  double error_m = 0;  ///< at the end
  std::optional<Contact> contact;
  bool contact_reported = true;  ///< after a contact the planner's next report was UNSAFE contact
  planner::Reason reason = planner::Reason::none;  ///< the planner's last one
  std::uint64_t infeasible_cycles = 0;             ///< the planner reported infeasible
  std::uint64_t cycles = 0, saturated_steps = 0;
  int goals_reached = 0, goals_missed = 0;                   ///< of a cycle of goals
  int contacts_by_arm = 0, contacts_by_others = 0;           ///< each counted once, where it begins
  std::uint64_t unsafe_cycles = 0, unreported_contacts = 0;  ///< the planner said UNSAFE; did not say contact
  double jerkiness = 0;                                      ///< total variation of qdd [rad/s^2 per s]
  std::optional<Dropout> dropout;                            ///< where the trial lived to see it
  Durations cycle;
};

/// Runs `scene` until it is reached, something touches, or its duration is over.
///
/// A cycle of goals ends at the duration, timed_out.
/// Reached: position goals within goal_tolerance_m below goal_speed for goal_hold_s; pose and joint goals
/// with their tolerances.  Stuck: not reached and the planner's last state is STUCK.  Failed: the integrator
/// refused a step, or the planner asked for a number that is not finite.
Trial run_trial(const scene::Scene& scene, const TrialOptions& options = {});

}  // namespace hamel::client
