#pragma once
/// What a planner is made of.  Its cycle is in three files: planner.cpp takes the input in and reports,
/// pursuit.cpp follows the goal, steering.cpp makes the torque.

#include <vector>

#include "services/planner/core/arm.h"
#include "services/planner/core/attraction.h"
#include "services/planner/core/barrier.h"
#include "services/planner/core/gyro.h"
#include "services/planner/core/monitor.h"
#include "services/planner/core/pairs.h"
#include "services/planner/core/planner.h"
#include "services/planner/core/reachable.h"

namespace hamel::planner {

inline constexpr double kLeastPeriod_s = 1e-6;  ///< of a command
inline constexpr double kFresh_s =
    0.02;  ///< a state older than this, or than two periods, is carried on to now
inline constexpr std::uint64_t kFlips = 2;  ///< sides tried before an arm that circulates is called stuck

struct Planner::Impl {
  Impl(const scene::Robot& robot, const Options& o, const Savings& savings)
      : options(o),
        arm(robot.chain),
        attraction(arm, options),
        gyro(arm, options),
        barrier(arm, options),
        obstacles(workspace(robot)),
        pairs(robot, options, savings),
        tau_att(Eigen::VectorXd::Zero(arm.n())),
        qdd_att(tau_att),
        qdd_rest(tau_att),
        qdd(tau_att),
        q_now(tau_att),
        scratch(kMaxPairs) {
    waypoint.kind = scene::GoalKind::joints;
    waypoint.joints = tau_att;
    if (options.method == scene::Method::gyro &&
        options.barrier_gain > 0)  // the barrier must see an obstacle in time
      options.vmax_mps = std::min(options.vmax_mps, options.barrier_gain * options.rho0_m);
  }

  Verdict see(const Input& in) noexcept;
  void prepare(const Input& in) noexcept;
  Verdict move(const Input& in, Eigen::VectorXd& tau) noexcept;
  void steer(const Input& in, bool refused, Eigen::VectorXd& tau) noexcept;
  void circulate(const Input& in, Eigen::VectorXd& tau) noexcept;
  double open_tank(double dt_s) noexcept;
  bool guard(const Input& in, Eigen::VectorXd& tau) noexcept;
  double braking_rate(double dt_s) const noexcept;
  void brake(double dt_s, Eigen::VectorXd& tau) noexcept;
  void report(const Verdict& verdict, Report& out) noexcept;
  double slow_down(const Input& in) const noexcept;
  bool fits(const scene::Goal& wanted) const noexcept;
  void pursue(const scene::Goal& wanted, const Reachability& found);
  Verdict approached(Verdict verdict) noexcept;
  bool approaching() const noexcept {
    return !goal_reachable && options.unreachable == scene::Unreachable::approach;
  }
  bool near_enough() const noexcept;
  bool target_blocked(bool for_good) const noexcept;
  void remember_tip() noexcept;
  bool pass_waypoint(const Input& in) noexcept;
  bool ask_for_escape(const Input& in, const Verdict& verdict) noexcept;

  Options options;
  Arm arm;
  Attraction attraction;
  Gyro gyro;
  Barrier barrier;
  Obstacles obstacles;
  Pairs pairs;
  Barrier::Outcome outcome;
  Eigen::VectorXd tau_att, qdd_att, qdd_rest, qdd;
  Eigen::VectorXd q_now;  // the state carried on to now
  double lag_s = 0;       // by so much
  std::vector<HeldPair> scratch;
  scene::Goal goal, sought;                            // `sought` as it came
  scene::Goal waypoint;                                // as a goal
  Reachability reach;                                  // of the last goal that is no joints'
  Eigen::Vector3d beyond_W = Eigen::Vector3d::Zero();  // from where the arm is sent to a target out of reach
  bool has_goal = false, goal_fits = true, goal_reachable = true, looked = false, asked = false,
       target_is_blocked = false;
  GoalError goal_error;
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();
  double tip_speed = 0;
  double pull_share = 1;  // of the attraction that ramp and amax let through
  Memory memory;
};

}  // namespace hamel::planner
