#include "services/planner/core/escape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/base/random.h"
#include "common/rbd/rbd.h"
#include "services/planner/core/reachable.h"

namespace hamel::planner {
namespace {

using Eigen::VectorXd;

constexpr double kStep_s = 0.01;

// Near waypoints first, then anywhere: a small detour is the likelier one to be free, and the shorter.
VectorXd draw_waypoint(const model::Chain& chain, const VectorXd& q, double spread, SplitMix64& dice) {
  VectorXd w(chain.n());
  for (int j = 0; j < chain.n(); ++j) {
    const model::JointLimits& limits = chain.joint(j).limits;
    const bool revolute = chain.joint(j).kind == model::JointKind::revolute;
    const double reach = spread * (revolute ? std::numbers::pi : 0.5);
    const double margin = std::min(0.1, 0.1 * (limits.upper - limits.lower));
    const double low = std::max(q[j] - reach, limits.lower + margin);
    const double high = std::min(q[j] + reach, limits.upper - margin);
    w[j] = dice.uniform(std::min(low, high), std::max(low, high));
  }
  return w;
}

// From there on to the goal: another posture to meet it with, if the way there is found.
void go_to_goal(const model::Chain& chain, const scene::Goal& goal, const Options& options,
                VectorXd& waypoint) {
  if (goal.kind == scene::GoalKind::joints) return;
  const VectorXd q = configuration_at(chain, goal, options, waypoint);
  if (q.size() > 0) waypoint = q;
}

/// The planner and a model of the arm, stepped together.
class Rollout {
 public:
  Rollout(const scene::Robot& robot, const Options& options, const std::function<bool()>& stop)
      : options_(without_escapes(options)),
        robot_(robot),
        planner_(robot, options_),
        out_(planner_.output()),
        chain_(weightless(robot.chain)),
        ws_(chain_),
        qdd_(VectorXd::Zero(chain_.n())),
        stop_(stop) {}

  struct Ending {
    bool reached = false;
    double t_s = 0;
  };

  /// @param waypoint  none: empty
  Ending run(const EscapeQuestion& from, const VectorXd& waypoint, double most_s) {
    planner_ = Planner(robot_, options_);
    planner_.set_goal(from.goal);
    q_ = from.q;
    qd_ = from.qd;
    obstacles_ = from.obstacles;
    const int steps = static_cast<int>(most_s / kStep_s);
    for (int k = 0; k < steps && !stopped(); ++k) {
      const double t_s = k * kStep_s;
      planner_.plan({.step = static_cast<std::uint64_t>(k),
                     .t_s = t_s,
                     .dt_s = kStep_s,
                     .q = q_,
                     .qd = qd_,
                     .obstacles = obstacles_,
                     .obstacle_age_s = k == 0 ? from.obstacle_age_s : 0},
                    out_);
      if (k == 0) planner_.take_escape(waypoint, t_s);  // the first cycle has begun the goal
      const Report& r = out_.report;
      if (r.state == State::reached) return {true, t_s};
      if (r.state == State::stuck || r.state == State::fault || r.reason == Reason::contact) break;
      advance();
    }
    return {false, most_s};
  }

 private:
  static Options without_escapes(Options o) {
    o.escapes = 0;
    o.ramp_s = 0;
    return o;
  }
  bool stopped() const noexcept { return stop_ && stop_(); }
  void advance() {
    rbd::forward_dynamics(chain_, q_, qd_, out_.torque_Nm, ws_, qdd_);
    qd_ += kStep_s * qdd_;
    q_ += kStep_s * qd_;
    for (geometry::Obstacle& o : obstacles_)
      if (o.velocity_known) o.X_WO = lie::moved(o.X_WO, o.V_WO, kStep_s);
  }

  Options options_;
  const scene::Robot& robot_;
  Planner planner_;
  Output out_;
  model::Chain chain_;
  rbd::Workspace ws_;
  VectorXd q_, qd_, qdd_;
  std::vector<geometry::Obstacle> obstacles_;
  const std::function<bool()>& stop_;
};

}  // namespace

Escape find_escape(const scene::Robot& robot, const Options& options, const EscapeQuestion& question,
                   const std::function<bool()>& stop) {
  Escape escape;
  if (question.q.size() != robot.chain.n() || question.q.size() > static_cast<Eigen::Index>(kMaxWaypoint))
    return escape;
  EscapeQuestion from = question;
  from.goal.X_WG = lie::moved(from.goal.X_WG, from.goal.V_WG, from.goal_age_s);
  Rollout rollout(robot, options, stop);
  SplitMix64 dice(question.step * 0x2545f4914f6cdd1dull + question.tries);
  double most_s = options.escape_horizon_s;
  if (!question.stuck && rollout.run(from, {}, most_s).reached) return escape;
  for (int k = 0; k < options.escape_rollouts; ++k) {
    const double spread = k % 4 == 0 ? 0.15 : k % 4 == 1 ? 0.3 : k % 4 == 2 ? 0.6 : 1.0;
    VectorXd waypoint = draw_waypoint(robot.chain, question.q, spread, dice);
    if (k % 2 == 1) go_to_goal(robot.chain, from.goal, options, waypoint);
    const Rollout::Ending ending = rollout.run(from, waypoint, most_s);
    ++escape.rollouts;
    if (stop && stop()) return {};
    if (!ending.reached) continue;
    escape.found = true;
    escape.waypoint = waypoint;
    escape.reached_after_s = most_s = ending.t_s;
  }
  return escape;
}

}  // namespace hamel::planner
