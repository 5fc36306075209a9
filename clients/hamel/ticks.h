#pragma once
/// A scene's services as plain ticks in one loop: what a lockstep run computes, without bus, log or clock.

#include <functional>
#include <memory>
#include <optional>

#include "common/scene/cadence.h"
#include "common/wire/messages.h"
#include "services/dynamics/arm.h"
#include "services/perception/core/source.h"
#include "services/planner/core/escape.h"
#include "services/planner/core/planner.h"
#include "services/planner/obstacle_view.h"

namespace hamel::client {

/// Planner and integrator of one scene, step by step.  Same scene, same bits.
class Ticks {
 public:
  /// `scene` must be valid and outlive the ticks; reduced or not, it is run as it is.
  explicit Ticks(const scene::Scene& scene);

  /// One planner cycle where one is due.  Does nothing in a free motion.
  void plan() { plan(arm_.state(), arm_.t_s()); }
  /// The same for an arm of this state, whatever ours is.
  void plan(const dynamics::State& s, double t_s);
  /// One step of the arm.  False where it found no usable step.
  bool step();
  /// True after the scene's duration, or with the goal where the scene ends there.
  bool done() const;

  const dynamics::Arm& arm() const { return arm_; }
  const planner::Report& report() const { return output_.report; }
  /// Planner cycles so far.
  std::uint64_t cycles() const { return planner_.memory().cycles; }
  const Eigen::VectorXd& torque_Nm() const { return output_.torque_Nm; }

 private:
  void look(double t_s);

  const scene::Scene& scene_;
  dynamics::Arm arm_;
  scene::Cadence cadence_;
  planner::Planner planner_;
  planner::Output output_;
  planner::ObstacleView view_;
  std::optional<perception::Source> source_;
  planner::Escape escape_;
  std::optional<std::uint64_t> escape_due_;  ///< the step at which it enters
  wire::ObstacleSet set_;
  wire::Causes causes_;
  std::uint64_t last_step_ = 0, next_set_ = 0;
};

}  // namespace hamel::client
