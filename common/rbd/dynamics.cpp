#include <cassert>

#include "common/rbd/rbd.h"

namespace hamel::rbd {

void inverse_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> qdd, Workspace& ws, Ref<VectorXd> tau) noexcept {
  assert(q.size() == chain.n() && qd.size() == chain.n() && qdd.size() == chain.n() &&
         tau.size() == chain.n());
  inverse_dynamics(ws.axis, q.data(), qd.data(), qdd.data(), ws.sweep, tau.data());
}

void bias_torque(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd, Workspace& ws,
                 Ref<VectorXd> c) noexcept {
  assert(q.size() == chain.n() && qd.size() == chain.n() && c.size() == chain.n());
  const lie::Vec3<double> gravity = ws.axis.gravity_W;
  ws.axis.gravity_W = {};
  c.setZero();
  inverse_dynamics(ws.axis, q.data(), qd.data(), c.data(), ws.sweep, c.data());
  ws.axis.gravity_W = gravity;
}

void forward_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> tau, Workspace& ws, Ref<VectorXd> qdd) noexcept {
  assert(q.size() == chain.n() && qd.size() == chain.n() && tau.size() == chain.n() &&
         qdd.size() == chain.n());
  forward_dynamics(ws.axis, q.data(), qd.data(), tau.data(), ws.sweep, qdd.data());
}

}  // namespace hamel::rbd
