#include "services/dynamics/arm.h"

#include <algorithm>
#include <cmath>

namespace hamel::dynamics {

namespace {

/// Rate at which the brake takes momentum out [1/s]: rest (1 rad/s to 0.02) within 80 ms; half a step's worth
/// at most.
double brake_rate(double dt_s) { return std::min(50.0, 0.5 / dt_s); }

constexpr double kRest = 0.02;  // rad/s or m/s of every joint: at rest

/// True when gravity does work on some joint: it asks for torque in one of a few configurations.
bool gravity_works(Integrator& integrator, const Eigen::VectorXd& q0) {
  Eigen::VectorXd tau(q0.size());
  for (int k = 0; k < 4; ++k) {
    integrator.gravity_torque(q0 + Eigen::VectorXd::Constant(q0.size(), 0.7 * k), tau);
    if (tau.lpNorm<Eigen::Infinity>() > 1e-12) return true;
  }
  return false;
}

}  // namespace

Arm::Arm(const scene::Scene& scene)
    : options_(scene.dynamics),
      integrator_(scene.robot.chain, scene.dynamics),
      state_(integrator_.start(scene.q0, scene.qd0)),
      ws_(scene.robot.chain) {
  const model::Chain& chain = integrator_.chain();
  const int n = chain.n();
  tau_ = applied_ = tau_hold_ = tau_gravity_ = pull_ = Eigen::VectorXd::Zero(n);
  q_hold_ = state_.q;
  gravity_works_ = gravity_works(integrator_, state_.q);
  scale_J_ = gravity_works_ ? rbd::energy_scale(chain) : 0;
  brake_per_s_ = brake_rate(options_.dt_s);
  report_ = StepReport{.stop = Stop::converged};
  books_.energy_J = books_.energy_start_J = integrator_.energy(state_);
  books_.kinetic_max_J = kinetic_energy();
}

void Arm::drive_torque(const Drive& drive) noexcept {
  const bool hold = drive.kind == DriveKind::hold || (drive.kind == DriveKind::torque && drive.share < 1);
  if (hold) hold_torque();
  holding_ &= hold;
  switch (drive.kind) {
    case DriveKind::free:
      tau_.setZero();
      return;
    case DriveKind::torque:
      tau_ = *drive.torque_Nm;
      if (!drive.includes_gravity && gravity_works_) {
        integrator_.gravity_torque(state_.q, tau_gravity_);
        tau_ += tau_gravity_;
      }
      if (hold) tau_ = drive.share * tau_ + (1 - drive.share) * tau_hold_;
      return;
    case DriveKind::brake:
      integrator_.gravity_torque(state_.q, tau_);
      tau_ -= brake_per_s_ * state_.p;
      return;
    case DriveKind::hold:
      tau_ = tau_hold_;
      return;
  }
}

/// A brake until the arm has come to rest, then critically damped about that place:
///   M qdd = -(b/2)^2 M (q - q_hold) - b p.
/// About where holding began, it would swing back to what it came from.
void Arm::hold_torque() noexcept {
  if (!holding_) {
    q_hold_ = state_.q;
    holding_ = state_.qd.lpNorm<Eigen::Infinity>() < kRest;
  }
  pull_ = (-0.25 * brake_per_s_ * brake_per_s_) * (state_.q - q_hold_);
  tau_gravity_.setZero();
  rbd::inverse_dynamics(integrator_.chain(), state_.q, tau_gravity_, pull_, ws_, tau_hold_);
  tau_hold_ -= brake_per_s_ * state_.p;
}

bool Arm::advance(const Drive& drive) noexcept {
  drive_torque(drive);
  report_ = integrator_.step(state_, tau_);
  if (!report_.usable()) return false;
  applied_ = integrator_.torque_applied();
  books_.work_J += report_.work_J;
  books_.energy_J = integrator_.energy(state_);
  books_.drift_J =
      std::max(books_.drift_J, std::abs(books_.energy_J - books_.energy_start_J - books_.work_J));
  books_.kinetic_max_J = std::max(books_.kinetic_max_J, kinetic_energy());
  books_.iterations_sum += report_.iterations;
  books_.iterations_max = std::max(books_.iterations_max, static_cast<std::uint32_t>(report_.iterations));
  books_.residual_max_Nm = std::max(books_.residual_max_Nm, report_.residual_Nm);
  books_.substepped += report_.substeps > 1 ? 1 : 0;
  ++books_.steps;
  return true;
}

double Arm::energy_drift_rel() const noexcept {
  const double scale = scale_J_ > 0 ? scale_J_ : books_.kinetic_max_J;
  return scale > 0 ? books_.drift_J / scale : 0;
}

void Arm::restore(const State& state, const Books& books, const Eigen::VectorXd& applied,
                  const Eigen::VectorXd* held) {
  state_ = state;
  applied_ = applied;
  books_ = books;
  holding_ = held != nullptr;
  if (held) q_hold_ = *held;
}

}  // namespace hamel::dynamics
