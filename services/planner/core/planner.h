#pragma once
/// One cycle of reactive planning: where the arm and the obstacles are now, which torque steers it.
///
/// Eqs. (17)-(21) of the paper and what makes them safe (numbers like "1.5" are those of the planner design):
///   tau = attraction (17) - bj M qd + forces of the obstacles.
/// The torque EXCLUDES gravity; who applies it adds the compensation.

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry/shape.h"
#include "common/scene/options.h"
#include "common/scene/scene.h"
#include "services/planner/core/memory.h"
#include "services/planner/core/savings.h"

namespace hamel::planner {

using Options = scene::PlannerOptions;

/// In the order of the wire's enums.
enum class State : std::uint8_t { idle, moving, reached, stuck, unsafe, fault };
enum class Reason : std::uint8_t {
  none,
  local_minimum,
  joint_limit,
  goal_blocked,
  unreachable,
  orbit,
  contact,
  stale_obstacles,
  stale_state,
  infeasible,
  non_finite,
  torque_limit,
  driver,  ///< of an arm's driver that reports in the planner's place: nothing here says it
  configuration,
  internal
};

/// "MOVING", "local_minimum": the names users see.
const char* to_string(State v) noexcept;
const char* to_string(Reason v) noexcept;

/// What one cycle reads.
struct Input {
  std::uint64_t step = 0;                         ///< of the arm state
  double t_s = 0;                                 ///< sample time of the arm state
  double dt_s = 1e-3;                             ///< how long the command will hold, > 0
  const Eigen::VectorXd& q;                       ///< n [rad or m]
  const Eigen::VectorXd& qd;                      ///< n [rad/s or m/s]
  std::span<const geometry::Obstacle> obstacles;  ///< as stamped; any order
  /// How old the obstacles are: they are extrapolated by it, inflated and, beyond the options' limits, braked
  /// for. +inf: no set ever arrived.  A set that promised no successor (next_t_s = +inf) does not age: pass
  /// 0.
  double obstacle_age_s = 0;
  /// Changes with every new obstacle set: what is out of reach of a set is then sorted out once and not every
  /// cycle.  0: not known.  The output is the same either way.
  std::uint64_t obstacle_set = 0;
  double state_age_s = 0;  ///< how old the arm state is: beyond two periods or 20 ms it goes on with qd
  bool obstacles_expected = false;  ///< the scene has perception: no motion before its first set
  /// For each link a distance, less inflation, that no obstacle comes under; or empty: nothing is known.  A
  /// link above rho0 is asked for distances only while its floor is below the clearance of the others; its
  /// report shows no obstacle then.
  std::span<const double> link_floor_m = {};
};

/// The obstacle nearest to one link and the forces it made there; world frame.
struct LinkReport {
  std::uint32_t link = 0, obstacle = 0;  ///< obstacle id, meaningful where distance is finite
  double distance_m = std::numeric_limits<double>::infinity();
  Eigen::Vector3d point_on_link_m = Eigen::Vector3d::Zero(), point_on_obstacle_m = Eigen::Vector3d::Zero();
  double closing_speed_mps = 0;  ///< > 0: approaching
  double phi_rad = 0;            ///< angle between motion and obstacle
  double gate = 0;               ///< see gate()
  Eigen::Vector3d gyroscopic_N = Eigen::Vector3d::Zero(), repulsive_N = Eigen::Vector3d::Zero();
  double barrier_multiplier = 0;  ///< [N] push of the barrier along -n
};

struct Report {
  State state = State::idle;
  Reason reason = Reason::none;
  const char* detail = "";    ///< one sentence for people, static storage
  std::uint64_t goal_id = 0;  ///< 0: none
  double target_error_m = 0;  ///< joints: largest difference [rad or m]
  double orientation_error_rad = 0;
  double speed_mps = 0;  ///< of the end effector
  Eigen::Vector3d end_effector_m = Eigen::Vector3d::Zero();
  double clearance_m = std::numeric_limits<double>::infinity();       ///< smallest distance now
  double clearance_min_m = std::numeric_limits<double>::infinity();   ///< smallest so far
  double self_clearance_m = std::numeric_limits<double>::infinity();  ///< of two links that must not touch
  std::uint64_t contacts = 0;                                         ///< cycles with clearance < 0 so far
  double path_length_m = 0;                                           ///< of the end effector so far
  double time_to_goal_s = -1;                                         ///< < 0: not reached yet
  double gyroscopic_power_W = 0;           ///< 0 but for rounding where the mapping is powerless
  double injected_power_W = 0;             ///< by moving obstacles and circulation
  double kinetic_J = 0, attraction_J = 0;  ///< of the arm; of the pull, kp/2 e^T Lam e
  double tank_J = 0;                       ///< what circulation may still spend
  int pairs_in_range = 0;                  ///< (link shape, obstacle) pairs acted on
  int pairs_dropped = 0;                   ///< in range but beyond kMaxPairs: the farthest ones
  int barrier_rows = 0;                    ///< distances and limits it looked at
  int velocities_estimated = 0, velocities_unknown = 0;  ///< obstacles that do not tell theirs
  /// Stuck, or lagging, and a way out may be found: ask find_escape() about this cycle's input with this many
  /// tries and tell take_escape() what it says.  Asked once; then `escape_waiting` until it is told.
  bool escape_asked = false, escape_waiting = false;
  std::uint64_t escapes = 0;      ///< questions so far at this goal
  std::vector<LinkReport> links;  ///< n, from base to tip
};

/// What one cycle writes.  Make it with Planner::output() so that plan() has nothing to allocate.
struct Output {
  Eigen::VectorXd torque_Nm;
  Report report;
};

struct EscapeQuestion;
struct ReachQuestion;
struct Reachability;

/// A planner bound to one robot and one set of options.  Not for two threads at once.
class Planner {
 public:
  /// `options` must be valid (scene::problems()).  Link shapes are taken as they are.
  /// @param savings  what need not be measured in each cycle
  Planner(const scene::Robot& robot, const Options& options, const Savings& savings = {});
  ~Planner();
  Planner(Planner&&) noexcept;
  Planner& operator=(Planner&&) noexcept;

  /// An output of the right sizes.
  Output output() const;
  /// A goal with a new id resets holds, flips and progress clocks; the same id again only moves the target.
  /// A goal that does not fit the robot (number of joints, not finite) makes plan() report FAULT
  /// configuration.  Whether the arm can meet it is searched for at once, for milliseconds; allocates.
  void set_goal(const scene::Goal& goal);
  /// The same for a control thread: what set_goal() would search for, none where it need not, and the goal
  /// with what was found elsewhere (reachable.h).
  std::optional<ReachQuestion> reach_question(const scene::Goal& goal) const;
  void set_goal(const scene::Goal& goal, const Reachability& found);
  /// What was found for the goal that holds.
  const Reachability& reach() const noexcept;
  void clear_goal();
  /// After a restart that lost its memory: the attraction ramps in over `ramp_s`, starting with a hold.
  void ramp_in() noexcept;
  /// What report.escape_asked asks, of the cycle just planned; the answer is due `escape_steps` steps after
  /// that cycle's.  Allocates.
  EscapeQuestion escape_question(const Input& input) const;
  std::uint64_t escape_steps(double dt_step_s) const noexcept;
  /// The answer to report.escape_asked: by way of this configuration, or none (empty).
  void take_escape(const Eigen::VectorXd& waypoint, double t_s) noexcept;
  /// One cycle.  Same memory and same input: same output, bit for bit.  No allocation, no throw, no clock.
  /// Whatever the input, the torque is finite.
  void plan(const Input& input, Output& output) noexcept;
  /// What plan() carries from cycle to cycle.  restore() of a saved one (and set_goal() of the same goal)
  /// continues exactly where it was saved.
  const Memory& memory() const noexcept;
  void restore(const Memory& memory) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hamel::planner
