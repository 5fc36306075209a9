#include "services/dynamics/core/rivals.h"

namespace hamel::dynamics {

Field::Field(const model::Chain& chain, const rbd::AxisChain& axis, double stop_stiffness)
    : chain_(chain),
      axis_(axis),
      stop_stiffness_(stop_stiffness),
      ws_(chain),
      tau_(VectorXd::Zero(chain.n())) {}

double Field::operator()(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) noexcept {
  double power = 0;
  for (int i = 0; i < axis_.n(); ++i) {
    tau_[i] = tau[i] + (stop_stiffness_ > 0 ? stop_torque(axis_[i], stop_stiffness_, q[i]) : 0);
    power += (tau_[i] - axis_[i].damping * qd[i]) * qd[i];
  }
  rbd::forward_dynamics(chain_, q, qd, tau_, ws_, qdd);
  return power;
}

SemiImplicitEulerStep::SemiImplicitEulerStep(const model::Chain& chain, const rbd::AxisChain& axis,
                                             const Options& options)
    : axis_(axis),
      field_(chain, axis, options.stop_stiffness),
      q_(VectorXd::Zero(chain.n())),
      qd_(q_),
      qdd_(q_) {}

StepReport SemiImplicitEulerStep::advance(const Node& from, const VectorXd& tau, double h,
                                          Node& to) noexcept {
  StepReport report;
  const double power = field_(from.q, from.qd, tau, qdd_);
  qd_ = from.qd + h * qdd_;
  q_ = from.q + h * qd_;
  // the torques that acted, over the way that was made
  report.work_J = h * (power + h * tau.dot(qdd_));
  to.place(axis_, q_);
  to.move_with_velocity(axis_, qd_);
  report.stop = Stop::explicit_step;
  report.evaluations = 1;
  return report;
}

Rk4Step::Rk4Step(const model::Chain& chain, const rbd::AxisChain& axis, const Options& options)
    : axis_(axis),
      field_(chain, axis, options.stop_stiffness),
      q_(VectorXd::Zero(chain.n())),
      qd_(q_),
      qdd_(q_),
      sum_q_(q_),
      sum_qd_(q_) {}

StepReport Rk4Step::advance(const Node& from, const VectorXd& tau, double h, Node& to) noexcept {
  constexpr double kNode[] = {0.5, 0.5, 1, 0}, kWeight[] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  StepReport report;
  q_ = from.q, qd_ = from.qd;
  sum_q_.setZero(), sum_qd_.setZero();
  for (int s = 0; s < 4; ++s) {
    report.work_J += h * kWeight[s] * field_(q_, qd_, tau, qdd_);
    sum_q_ += kWeight[s] * qd_;
    sum_qd_ += kWeight[s] * qdd_;
    q_ = from.q + kNode[s] * h * qd_;
    qd_ = from.qd + kNode[s] * h * qdd_;
  }
  q_ = from.q + h * sum_q_;
  qd_ = from.qd + h * sum_qd_;
  to.place(axis_, q_);
  to.move_with_velocity(axis_, qd_);
  report.stop = Stop::explicit_step;
  report.evaluations = 4;
  return report;
}

}  // namespace hamel::dynamics
