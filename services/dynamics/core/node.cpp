#include "services/dynamics/core/node.h"

namespace hamel::dynamics {
namespace {

/// U = -g . sum m r, the first moment carried from the tip to the world.
template <class G>
struct Moment {
  const typename G::Chain& chain;
  const typename G::template Frame<double>* X;
  typename G::template Direction<double> sum{};
  [[gnu::always_inline]] void operator()(int i) noexcept {
    add_moment(chain[i], X[i], sum);
    sum = moment_to_parent(chain[i], X[i], sum);
  }
  double potential_J() const noexcept { return chain.potential_offset - dot(chain.gravity_W, sum); }
};

}  // namespace

template <class G>
Node<G>::Node(const Chain& chain)
    : q(VectorXd::Zero(chain.n())),
      p(q),
      qd(q),
      X(static_cast<std::size_t>(chain.n())),
      factor(X.size()),
      scratch_(q),
      momentum_(X.size()) {}

template <class G>
void Node<G>::place(const Chain& chain, const VectorXd& q_new) noexcept {
  q = q_new;
  rbd::place(chain, q.data(), X.data());
}

template <class G>
void Node<G>::move_with_momentum(const Chain& chain) noexcept {
  Moment<G> moment{chain, X.data()};
  rbd::Inward<G, double> inward{chain, X.data(), factor.data(), p.data(), scratch_.data()};
  rbd::factorise<G, double>(chain, X.data(), nullptr, factor.data(), [&](int i) { inward(i), moment(i); });
  // numbers just written are not read two at a time: that would wait for both stores
  const double* momenta = p.data();
  double* rate = qd.data();
  double twice = 0;
  rbd::solve_outward<G, double>(chain, X.data(), factor.data(), scratch_.data(), [&](int i, double x) {
    rate[i] = x;
    twice += momenta[i] * x;
  });
  kinetic_J = 0.5 * twice;
  energy_J = kinetic_J + moment.potential_J();
}

template <class G>
void Node<G>::move_with_velocity(const Chain& chain, const VectorXd& qd_new) noexcept {
  qd = qd_new;
  const double* rate = qd.data();
  typename G::template Motion<double> V, h;
  for (int i = 0; i < chain.n(); ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    V = to_child(X[s], V);
    add_along(chain[i], X[s], V, rate[i]);
    momentum_[s] = momentum(chain[i], X[s], V);
  }
  Moment<G> moment{chain, X.data()};
  for (int i = chain.n(); i-- > 0;) {
    const std::size_t s = static_cast<std::size_t>(i);
    h = h + momentum_[s];
    p.data()[i] = along(chain[i], X[s], h) + chain[i].armature * rate[i];
    h = to_parent(X[s], h);
    moment(i);
  }
  kinetic_J = 0.5 * p.dot(qd);
  energy_J = kinetic_J + moment.potential_J();
}

template struct Node<SE3>;
template struct Node<SE2>;

}  // namespace hamel::dynamics
