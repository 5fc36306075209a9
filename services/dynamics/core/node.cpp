#include "services/dynamics/core/node.h"

#include <cmath>

namespace hamel::dynamics {
namespace {

std::size_t size(const rbd::AxisChain& chain) { return static_cast<std::size_t>(chain.n()); }

/// U = -g . sum m r, the first moment carried from the tip to the world.
double potential(const rbd::AxisChain& chain, const LinkPoses& X) noexcept {
  lie::Vec3<double> moment;
  for (int i = chain.n(); i-- > 0;) {
    const auto& [R, p] = X[static_cast<std::size_t>(i)];
    moment = R * (moment + chain[i].h) + chain[i].outer_mass * p;
  }
  return -dot(chain.gravity_W, moment);
}

}  // namespace

Node::Node(const rbd::AxisChain& chain)
    : q(VectorXd::Zero(chain.n())),
      p(q),
      qd(q),
      X(size(chain)),
      factor(size(chain)),
      scratch_(q),
      momentum_(size(chain)) {}

void Node::place(const rbd::AxisChain& chain, const VectorXd& q_new) noexcept {
  q = q_new;
  for (int i = 0; i < chain.n(); ++i) X[static_cast<std::size_t>(i)] = rbd::pose_at(chain[i], q[i]);
  rbd::factorise<double>(chain, X.data(), nullptr, factor.data());
  potential_J = potential(chain, X);
}

void Node::move_with_momentum(const rbd::AxisChain& chain, const VectorXd& p_new) noexcept {
  p = p_new;
  rbd::solve(chain, X.data(), factor.data(), p.data(), scratch_.data(), qd.data());
  energy_J = 0.5 * p.dot(qd) + potential_J;
}

void Node::move_with_velocity(const rbd::AxisChain& chain, const VectorXd& qd_new) noexcept {
  qd = qd_new;
  rbd::Half6<double> V, h;
  for (int i = 0; i < chain.n(); ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    V = to_child(X[s], V);
    along(chain[i], V) += qd[i];
    momentum_[s] = momentum(chain[i], V);
  }
  for (int i = chain.n(); i-- > 0;) {
    const std::size_t s = static_cast<std::size_t>(i);
    h = h + momentum_[s];
    p[i] = along(chain[i], h) + chain[i].armature * qd[i];
    h = to_parent(X[s], h);
  }
  energy_J = 0.5 * p.dot(qd) + potential_J;
}

bool Node::finite() const noexcept {
  return std::isfinite(energy_J) && q.allFinite() && p.allFinite() && qd.allFinite();
}

}  // namespace hamel::dynamics
