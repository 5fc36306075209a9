#pragma once
/// One simulated arm: the integrator, the torques it is really given, and the books kept over a run.
/// Pure: no bus, no clock, no log.  Same drives, same states.

#include <Eigen/Core>

#include "common/rbd/rbd.h"
#include "common/scene/scene.h"
#include "services/dynamics/core/integrator.h"

namespace hamel::dynamics {

/// What moves the arm over one step.
enum class DriveKind : std::uint8_t {
  free,    ///< no torque at all
  torque,  ///< the command's torque, gravity compensation added unless it includes it
  brake,   ///< come to rest where it is: gravity compensation and -b p
  hold,    ///< come to rest and keep the place
};

struct Drive {
  DriveKind kind = DriveKind::free;
  const Eigen::VectorXd* torque_Nm = nullptr;  ///< kind torque: n values
  bool includes_gravity = false;
  double share = 1;  ///< kind torque: of the command; the rest is `hold`.  0..1
};

/// What a run came to so far.
struct Books {
  double work_J = 0;  ///< done on the arm by torques and damping
  double energy_J = 0, energy_start_J = 0;
  double drift_J = 0;  ///< largest |E - E0 - work|
  double kinetic_max_J = 0;
  double iterations_sum = 0;
  std::uint64_t steps = 0, substepped = 0;
  std::uint32_t iterations_max = 0;
  double residual_max_Nm = 0;
};

class Arm {
 public:
  /// `scene` must be valid and outlive the arm.  Allocates; nothing after it does.
  explicit Arm(const scene::Scene& scene);

  /// One step under `drive`.  False, with the state untouched, when the integrator found no usable step.
  bool advance(const Drive& drive) noexcept;

  const State& state() const noexcept { return state_; }
  double t_s() const noexcept { return static_cast<double>(state_.step) * options_.dt_s; }
  const Eigen::VectorXd& torque_applied() const noexcept { return applied_; }
  bool torque_saturated() const noexcept { return report_.saturated > 0; }
  const StepReport& report() const noexcept { return report_; }
  const Books& books() const noexcept { return books_; }
  const Options& options() const noexcept { return options_; }
  /// Books::drift_J over the energy scale of the scene (agreements): sum m |g| r, or the largest kinetic
  /// energy where gravity does nothing; 0 where nothing moved.
  double energy_drift_rel() const noexcept;

  /// The place that is held; none while nothing is held or the arm still comes to rest.
  const Eigen::VectorXd* held() const noexcept { return holding_ ? &q_hold_ : nullptr; }
  /// Continues from a saved state, its books, the torque that was applied and the place held (null: none);
  /// exact.
  void restore(const State& state, const Books& books, const Eigen::VectorXd& applied,
               const Eigen::VectorXd* held);

 private:
  void drive_torque(const Drive& drive) noexcept;
  void hold_torque() noexcept;
  double kinetic_energy() const noexcept { return 0.5 * state_.p.dot(state_.qd); }

  Options options_;
  Integrator integrator_;
  State state_;
  StepReport report_;
  Books books_;
  Eigen::VectorXd tau_, applied_, tau_hold_, tau_gravity_, q_hold_, pull_;
  rbd::Workspace ws_;
  bool holding_ = false, gravity_works_ = false;
  double scale_J_ = 0, brake_per_s_ = 0;
};

}  // namespace hamel::dynamics
