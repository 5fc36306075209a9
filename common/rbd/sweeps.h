#pragma once
/// The recursions along a chain, written once: over the group G (SE3 or SE2) and any scalar S (a number, or
/// one per lane).

#include <vector>

#include "common/rbd/planar.h"
#include "common/rbd/spatial.h"

namespace hamel::rbd {

/// What one joint keeps of the articulated-body factorisation.
template <class G, class S>
struct Factor {
  typename G::template Motion<S> W;  ///< X^T I^A A / D, D = A^T I^A A + armature + extra; none for the first
  S D_inv{};                         ///< 1 / D
};

/// Articulated-body factorisation of M(q) + diag(extra), O(n).  `extra` may be null.
/// The parent sees X^T (I^A - U U^T / D) X, U = I^A A, as X^T I^A X - (X^T U)(X^T U)^T / D: nothing but the
/// last product waits for the division.
/// Calls then(i) when joint i is done, from the tip: what else runs that way needs no pass of its own.
template <class G, class S, class Then>
[[gnu::always_inline]] inline void factorise(const typename G::Chain& chain,
                                             const typename G::template Frame<S>* X, const S* extra,
                                             Factor<G, S>* f, const Then& then) noexcept {
  typename G::template Inertia<S> I{};
  for (int i = chain.n(); i-- > 0;) {
    const auto& k = chain[i];
    add_rigid(k, X[i], I);
    auto U = joint_column(k, X[i], I);
    S D = along(k, X[i], U) + k.armature;
    if (extra) D = D + extra[i];
    f[i].D_inv = 1.0 / D;
    if (i > 0) {
      U = to_parent(X[i], U);
      f[i].W = f[i].D_inv * U;
      I = deflate(to_parent(X[i], I), f[i].W, U);
    }
    then(i);
  }
}
template <class G, class S>
[[gnu::always_inline]] inline void factorise(const typename G::Chain& chain,
                                             const typename G::template Frame<S>* X, const S* extra,
                                             Factor<G, S>* f) noexcept {
  factorise<G, S>(chain, X, extra, f, [](int) {});
}

/// The way from the tip of x = (M + diag(extra))^-1 (b - A^T W): u_i = (b_i - A_i^T p_i) / D_i.
template <class G, class S>
struct Inward {
  const typename G::Chain& chain;
  const typename G::template Frame<S>* X;
  const Factor<G, S>* f;
  const S* b;
  S* u;
  const typename G::template Motion<S>* wrench = nullptr;
  typename G::template Motion<S> p{};
  [[gnu::always_inline]] void operator()(int i) noexcept {
    if (wrench) p = p + wrench[i];
    const S y = b[i] - along(chain[i], X[i], p);
    u[i] = y * f[i].D_inv;
    if (i > 0) p = to_parent(X[i], p) + y * f[i].W;
  }
};
/// A put() for solve() that writes to x.
template <class S>
[[gnu::always_inline]] inline auto into(S* x) {
  return [x](int i, const S& x_i) { x[i] = x_i; };
}
/// The way back: calls put(i, x_i), from the base.
template <class G, class S, class Put>
[[gnu::always_inline]] inline void solve_outward(const typename G::Chain& chain,
                                                 const typename G::template Frame<S>* X,
                                                 const Factor<G, S>* f, const S* u, const Put& put) noexcept {
  typename G::template Motion<S> a{};
  for (int i = 0; i < chain.n(); ++i) {
    const S x = i > 0 ? u[i] - dot(f[i].W, a) : u[i];
    put(i, x);
    if (i > 0) a = to_child(X[i], a);
    add_along(chain[i], X[i], a, x);
  }
}
/// x = (M + diag(extra))^-1 (b - A^T W) from the factorisation, O(n), where W_i is the sum of the wrenches
/// `wrench` of link i and all beyond it (null: none).  Calls put(i, x_i), from the base, when b is no longer
/// read; `u` is scratch.
template <class G, class S, class Put>
[[gnu::always_inline]] inline void solve(const typename G::Chain& chain,
                                         const typename G::template Frame<S>* X, const Factor<G, S>* f,
                                         const S* b, S* u, const Put& put,
                                         const typename G::template Motion<S>* wrench = nullptr) noexcept {
  Inward<G, S> inward{chain, X, f, b, u, wrench};
  for (int i = chain.n(); i-- > 0;) inward(i);
  solve_outward<G, S>(chain, X, f, u, put);
}

/// factorise() and solve() in one pass from the tip: pays where registers are wide and links few.
template <class G, class S>
[[gnu::always_inline]] inline void factorise_and_solve(const typename G::Chain& chain,
                                                       const typename G::template Frame<S>* X,
                                                       Factor<G, S>* f, const S* b, S* u, S* x) noexcept {
  Inward<G, S> inward{chain, X, f, b, u};
  factorise<G, S>(chain, X, nullptr, f, [&](int i) { inward(i); });
  solve_outward<G, S>(chain, X, f, u, into(x));
}

/// Twists (5) and the wrenches F that the motion and gravity ask for, base to tip, Eq. (8): I a - ad_V^T I V.
/// With qdd null the joints' own acceleration is left out.
template <class G, class S>
[[gnu::always_inline]] inline void motion_wrenches(const typename G::Chain& chain, const S* qd, const S* qdd,
                                                   const typename G::template Frame<S>* X,
                                                   typename G::template Motion<S>* F) noexcept {
  typename G::template Motion<S> V{}, a = rising(chain.gravity_W);
  for (int i = 0; i < chain.n(); ++i) {
    const auto& k = chain[i];
    V = to_child(X[i], V);
    add_along(k, X[i], V, qd[i]);
    a = to_child(X[i], a) + bracket_with_axis(k, X[i], V, qd[i]);
    if (qdd) add_along(k, X[i], a, qdd[i]);
    F[i] = momentum(k, X[i], a) - coadjoint(V, momentum(k, X[i], V));
  }
}

/// Joint torques Q = sum J_i^T F_i of wrenches that act on the links at their origins, in world axes (SE(2):
/// the plane's), O(n).  R is scratch.
template <class G, class S>
[[gnu::always_inline]] inline void wrench_torques(const typename G::Chain& chain,
                                                  const typename G::template Frame<S>* X,
                                                  const typename G::template Motion<double>* wrench,
                                                  typename G::template Attitude<S>* R, S* Q) noexcept {
  for (int i = 0; i < chain.n(); ++i) R[i] = attitude(X[i], i > 0 ? &R[i - 1] : nullptr);
  typename G::template Motion<S> F{};
  for (int i = chain.n(); i-- > 0;) {
    add_in_link_axes(R[i], wrench[i], F);
    Q[i] = along(chain[i], X[i], F);
    if (i > 0) F = to_parent(X[i], F);
  }
}

/// Memory of the recursions for one chain.
template <class G>
struct Sweep {
  explicit Sweep(int n) : X(static_cast<std::size_t>(n)), F(X.size()), factor(X.size()), u(X.size()) {}
  std::vector<typename G::template Frame<double>> X;
  std::vector<typename G::template Motion<double>> F;
  std::vector<Factor<G, double>> factor;
  std::vector<double> u;
};

/// qdd from tau, damping taken off it, O(n).  The motion with qdd = 0 costs wrenches; what they leave of tau
/// meets M qdd.  qdd may be tau.
template <class G>
void forward_dynamics(const typename G::Chain& chain, const double* q, const double* qd, const double* tau,
                      Sweep<G>& w, double* qdd) noexcept {
  place(chain, q, w.X.data());
  motion_wrenches<G, double>(chain, qd, nullptr, w.X.data(), w.F.data());
  for (int i = 0; i < chain.n(); ++i) qdd[i] = tau[i] - chain[i].damping * qd[i];
  factorise<G, double>(chain, w.X.data(), nullptr, w.factor.data());
  solve<G, double>(chain, w.X.data(), w.factor.data(), qdd, w.u.data(), into(qdd), w.F.data());
}
/// tau = M qdd + c + tau_g, O(n).  tau may be qdd.
template <class G>
void inverse_dynamics(const typename G::Chain& chain, const double* q, const double* qd, const double* qdd,
                      Sweep<G>& w, double* tau) noexcept {
  place(chain, q, w.X.data());
  motion_wrenches<G, double>(chain, qd, qdd, w.X.data(), w.F.data());
  typename G::template Motion<double> F{};
  for (int i = chain.n(); i-- > 0;) {
    const std::size_t s = static_cast<std::size_t>(i);
    F = F + w.F[s];
    tau[i] = along(chain[i], w.X[s], F) + chain[i].armature * qdd[i];
    if (i > 0) F = to_parent(w.X[s], F);
  }
}

}  // namespace hamel::rbd
