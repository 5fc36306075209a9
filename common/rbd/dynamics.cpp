#include <cassert>

#include "common/rbd/rbd.h"

namespace hamel::rbd {
namespace {

/// Twists (5) and wrenches that the motion and gravity ask for, base to tip.  `a` is the classic trick: the
/// base accelerates against gravity.  With qdd null the joints' own acceleration is left out.
void forward_sweep(const double* q, const double* qd, const double* qdd, Workspace& ws) noexcept {
  const Vec3<double>& g = ws.axis.gravity_W;
  Half6<double> V{}, a{{}, {-g.x, -g.y, -g.z}};
  for (int i = 0; i < ws.axis.n(); ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    const AxisLink& k = ws.axis[i];
    ws.X[s] = pose_at(k, q[i]);
    V = to_child(ws.X[s], V);
    along(k, V) += qd[i];
    ws.V[s] = V;
    ws.c[s] = bracket_with_axis(k, V, qd[i]);
    a = to_child(ws.X[s], a) + ws.c[s];
    if (qdd) along(k, a) += qdd[i];
    // Eq. (8): I a - ad_V^T I V
    ws.F[s] = momentum(k, a) - coadjoint(V, momentum(k, V));
  }
}

}  // namespace

void inverse_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> qdd, Workspace& ws, Ref<VectorXd> tau) noexcept {
  assert(q.size() == chain.n() && qd.size() == chain.n() && qdd.size() == chain.n() &&
         tau.size() == chain.n());
  forward_sweep(q.data(), qd.data(), qdd.data(), ws);
  Half6<double> F{};
  for (int i = chain.n(); i-- > 0;) {
    const std::size_t s = static_cast<std::size_t>(i);
    const AxisLink& k = ws.axis[i];
    F = F + ws.F[s];
    tau[i] = along(k, F) + k.armature * qdd[i];
    if (i > 0) F = to_parent(ws.X[s], F);
  }
}

void forward_dynamics(const model::Chain& chain, Ref<const VectorXd> q, Ref<const VectorXd> qd,
                      Ref<const VectorXd> tau, Workspace& ws, Ref<VectorXd> qdd) noexcept {
  assert(q.size() == chain.n() && qd.size() == chain.n() && tau.size() == chain.n() &&
         qdd.size() == chain.n());
  // The motion with qdd = 0 costs wrenches; what they leave of tau meets M qdd.
  forward_sweep(q.data(), qd.data(), nullptr, ws);
  for (int i = 0; i < chain.n(); ++i) qdd[i] = tau[i] - ws.axis[i].damping * qd[i];
  factorise<double>(ws.axis, ws.X.data(), nullptr, ws.factor.data());
  solve(ws.axis, ws.X.data(), ws.factor.data(), qdd.data(), ws.u.data(), qdd.data(), ws.F.data());
}

}  // namespace hamel::rbd
