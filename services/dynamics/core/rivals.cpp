#include "services/dynamics/core/rivals.h"

namespace hamel::dynamics {

template <class G>
Field<G>::Field(const typename G::Chain& chain, double stop_stiffness)
    : chain_(chain),
      stop_stiffness_(stop_stiffness),
      sweep_(chain.n()),
      push_(chain.n()),
      tau_(VectorXd::Zero(chain.n())) {}

template <class G>
double Field<G>::operator()(const VectorXd& q, const VectorXd& qd, const Load<G>& load,
                            VectorXd& qdd) noexcept {
  if (load.pushed) rbd::place(chain_, q.data(), sweep_.X.data());
  push_.evaluate(chain_, sweep_.X, load);
  const double *at = q.data(), *rate = qd.data(), *commanded = load.tau.data(), *pushed = push_.data();
  double power = 0, *tau = tau_.data();
  for (int i = 0; i < chain_.n(); ++i) {
    tau[i] = commanded[i] + pushed[i];
    if (stop_stiffness_ > 0) tau[i] += stop_torque(chain_[i], stop_stiffness_, at[i]);
    power += (tau[i] - chain_[i].damping * rate[i]) * rate[i];
  }
  rbd::forward_dynamics(chain_, q.data(), qd.data(), tau_.data(), sweep_, qdd.data());
  return power;
}

template <class G>
SemiImplicitEulerStep<G>::SemiImplicitEulerStep(const typename G::Chain& chain, const Options& options)
    : chain_(chain),
      field_(chain, options.stop_stiffness),
      q_(VectorXd::Zero(chain.n())),
      qd_(q_),
      qdd_(q_) {}

template <class G>
StepReport SemiImplicitEulerStep<G>::advance(const Node<G>& from, const Load<G>& load, double h,
                                             Node<G>& to) noexcept {
  StepReport report;
  const double power = field_(from.q, from.qd, load, qdd_);
  qd_ = from.qd + h * qdd_;
  q_ = from.q + h * qd_;
  // the torques that acted, over the way that was made
  report.work_J = h * (power + h * field_.torque().dot(qdd_));
  to.place(chain_, q_);
  to.move_with_velocity(chain_, qd_);
  report.stop = Stop::explicit_step;
  report.evaluations = 1;
  return report;
}

template <class G>
Rk4Step<G>::Rk4Step(const typename G::Chain& chain, const Options& options)
    : chain_(chain),
      field_(chain, options.stop_stiffness),
      q_(VectorXd::Zero(chain.n())),
      qd_(q_),
      qdd_(q_),
      sum_q_(q_),
      sum_qd_(q_) {}

template <class G>
StepReport Rk4Step<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  constexpr double kNode[] = {0.5, 0.5, 1, 0}, kWeight[] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  StepReport report;
  q_ = from.q, qd_ = from.qd;
  sum_q_.setZero(), sum_qd_.setZero();
  for (int s = 0; s < 4; ++s) {
    report.work_J += h * kWeight[s] * field_(q_, qd_, load, qdd_);
    sum_q_ += kWeight[s] * qd_;
    sum_qd_ += kWeight[s] * qdd_;
    q_ = from.q + kNode[s] * h * qd_;
    qd_ = from.qd + kNode[s] * h * qdd_;
  }
  q_ = from.q + h * sum_q_;
  qd_ = from.qd + h * sum_qd_;
  to.place(chain_, q_);
  to.move_with_velocity(chain_, qd_);
  report.stop = Stop::explicit_step;
  report.evaluations = 4;
  return report;
}

template class Field<SE3>;
template class Field<SE2>;
template class SemiImplicitEulerStep<SE3>;
template class SemiImplicitEulerStep<SE2>;
template class Rk4Step<SE3>;
template class Rk4Step<SE2>;

}  // namespace hamel::dynamics
