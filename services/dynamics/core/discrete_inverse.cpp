#include "services/dynamics/core/discrete_inverse.h"

#include <cassert>

namespace hamel::dynamics {
namespace {

using Motion = rbd::Half6<double>;

/// Calls visit(i, twist of link i) for frames at `q` and joint rates (to - from)/dt.
template <class Visit>
void at_rates(rbd::Workspace& ws, const double* q, const double* from, const double* to, double dt,
              const Visit& visit) {
  auto& X = ws.sweep.X;
  rbd::place(ws.axis, q, X.data());
  Motion V;
  for (int i = 0; i < ws.axis.n(); ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    V = to_child(X[s], V);
    add_along(ws.axis[i], X[s], V, (to[i] - from[i]) / dt);
    visit(i, X[s], V);
  }
}

}  // namespace

void discrete_inverse_dynamics(const model::Chain& chain, rbd::Ref<const Eigen::VectorXd> q_prev,
                               rbd::Ref<const Eigen::VectorXd> q, rbd::Ref<const Eigen::VectorXd> q_next,
                               double dt_s, double alpha, rbd::Workspace& ws,
                               rbd::Ref<Eigen::VectorXd> tau) noexcept {
  assert(q_prev.size() == chain.n() && q.size() == chain.n() && q_next.size() == chain.n() &&
         tau.size() == chain.n());
  const rbd::AxisChain& axis = ws.axis;
  auto& wrench = ws.sweep.F;
  const double rate = 1 / dt_s;
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  at_rates(ws, q_prev.data(), q_prev.data(), q.data(), dt_s, [&](int i, const auto& X, const Motion& V) {
    const Motion IV = momentum(axis[i], X, V);
    wrench[at(i)] = -rate * IV - alpha * coadjoint(V, IV);
  });
  lie::Vec3<double> g = axis.gravity_W;
  at_rates(ws, q.data(), q.data(), q_next.data(), dt_s, [&](int i, const auto& X, const Motion& V) {
    const Motion IV = momentum(axis[i], X, V);
    g = turn_to_child(X, g);
    wrench[at(i)] =
        wrench[at(i)] + rate * IV - (1 - alpha) * coadjoint(V, IV) - gravity_wrench(axis[i], X, g);
  });
  Motion F;
  for (int i = axis.n(); i-- > 0;) {
    const auto& X = ws.sweep.X[at(i)];
    F = F + wrench[at(i)];
    const double second = ((q_next[i] - q[i]) - (q[i] - q_prev[i])) * rate * rate;
    tau[i] = along(axis[i], X, F) + axis[i].armature * second;
    F = to_parent(X, F);
  }
}

}  // namespace hamel::dynamics
