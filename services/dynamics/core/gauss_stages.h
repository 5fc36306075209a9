#pragma once
/// The kernel of gauss_lanes.h for one pack type; included by lanes_*.cpp alone.

#include "common/lie/pack.h"
#include "services/dynamics/core/gauss_lanes.h"
#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {

/// The memory of one bundle of stages, cut out of a job's scratch.
template <class G, class P>
struct StageScratch {
  typename G::template Frame<P>* X;
  rbd::Factor<G, P>* factor;
  typename G::template Motion<P>*V, *momentum;
  typename G::template Direction<P>* g;
  typename G::template Attitude<P>* R;
  P *Q, *P_, *u, *rate, *push;

  [[gnu::always_inline]] StageScratch(void* memory, int n) {
    auto* next = static_cast<unsigned char*>(memory);
    cut(next, X, n), cut(next, factor, n), cut(next, V, n), cut(next, momentum, n), cut(next, g, n),
        cut(next, R, n);
    cut(next, Q, n), cut(next, P_, n), cut(next, u, n), cut(next, rate, n), cut(next, push, n);
  }
  template <class T>
  [[gnu::always_inline]] static void cut(unsigned char*& next, T*& part, int n) {
    part = reinterpret_cast<T*>(next);
    next += (static_cast<std::size_t>(n) * sizeof(T) + 63) / 64 * 64;
  }
};

/// V and F of the stages from `first` by the last step's collocation polynomials.
template <class G, class P>
[[gnu::always_inline]] inline void carry_on(const StageJob<G>& job, int first) {
  const int n = job.chain->n();
  const double *V_past = job.past, *F_past = V_past + n * job.stages;
  for (int i = 0; i < n; ++i, V_past += job.stages, F_past += job.stages) {
    P V{}, F{};
    for (int j = 0; j < job.stages; ++j) {
      const P e = P::load(job.extrapolate + j * job.padded + first);
      V = V + e * V_past[j];
      F = F + e * F_past[j];
    }
    V.store(job.V + i * job.padded + first);
    F.store(job.F + i * job.padded + first);
  }
}

/// Q = q + h a V and P = p + h a F for the stages from `first`.
template <class G, class P>
[[gnu::always_inline]] inline void gather(const StageJob<G>& job, int first, const StageScratch<G, P>& w) {
  for (int i = 0; i < job.chain->n(); ++i) {
    P V{}, F{};
    for (int j = 0; j < job.stages; ++j) {
      const P a = P::load(job.a + j * job.padded + first);
      V = V + a * job.V[i * job.padded + j];
      F = F + a * job.F[i * job.padded + j];
    }
    w.Q[i] = job.q[i] + job.h * V;
    w.P_[i] = job.p[i] + job.h * F;
  }
}

/// Torque of the smooth hard stops, as tier.h's.
template <class P>
[[gnu::always_inline]] inline P stop_torque(const rbd::JointNumbers& k, double stiffness, const P& q) {
  const auto push = [&](const P& e) { return stiffness * (e * e * (1.0 / (e + P::of(kStopWidth)))); };
  return push(larger(k.lower - q, P{})) - push(larger(q - k.upper, P{}));
}

/// V = M(Q)^-1 P and F = dL/dq + joint torques for the stages from `first`, and their distance from job's V,
/// F.
template <class G, class P>
[[gnu::always_inline]] inline void evaluate_bundle(StageJob<G>& job, int first, P& impulse,
                                                   P& relative) noexcept {
  const auto& chain = *job.chain;
  const int n = chain.n();
  const double h = job.h;
  const StageScratch<G, P> w(job.scratch, n);
  gather(job, first, w);
  rbd::place(chain, w.Q, w.X);
  if (job.load->pushed) rbd::wrench_torques<G, P>(chain, w.X, job.load->wrench.data(), w.R, w.push);
  rbd::factorise_and_solve<G, P>(chain, w.X, w.factor, w.P_, w.u, w.rate);
  typename G::template Direction<P> g = P::of(1) * chain.gravity_W;
  typename G::template Motion<P> V{}, H{};
  for (int i = 0; i < n; ++i) {
    w.g[i] = g = turn_to_child(w.X[i], g);
    V = to_child(w.X[i], V);
    add_along(chain[i], w.X[i], V, w.rate[i]);
    w.V[i] = V;
    w.momentum[i] = momentum(chain[i], w.X[i], V);
  }
  typename G::template Direction<P> moment{};
  for (int i = n; i-- > 0;) {
    const auto& k = chain[i];
    const auto& X = w.X[i];
    const int at = i * job.padded + first;
    H = H + w.momentum[i];
    add_moment(k, X, moment);
    P applied = job.tau[i] - k.damping * w.rate[i];
    if (job.load->pushed) applied = applied + w.push[i];
    if (job.stop_stiffness > 0) applied = applied + stop_torque(k, job.stop_stiffness, w.Q[i]);
    const P F = coadjoint_along(k, X, w.V[i], H) + weight_along(k, X, moment, w.g[i]) + applied;
    applied.store(job.applied + at);
    w.rate[i].store(job.V_next + at);
    F.store(job.F_next + at);
    // mismatch and scale as momenta: a rate counts with the inertia it moves
    const P off =
        larger(h * abs(F - P::load(job.F + at)), job.inertia[i] * abs(w.rate[i] - P::load(job.V + at)));
    if (job.rescale) {
      const P scale = __builtin_fabs(job.p[i]) + abs(w.P_[i]) + job.inertia[i] * abs(w.rate[i]) +
                      h * (abs(F) + k.weight) + kNothing;
      (1.0 / scale).store(job.scale_inv + at);
    }
    const P poison = (F + w.rate[i]) * 0.0;  // not a number stays not a number
    impulse = larger(impulse, off) + poison;
    relative = larger(relative, off * P::load(job.scale_inv + at)) + poison;
    if (i == 0) break;
    H = to_parent(X, H);
    moment = moment_to_parent(k, X, moment);
  }
}

template <class G, class P>
[[gnu::always_inline]] inline void evaluate_stages(StageJob<G>& job) noexcept {
  P impulse{}, relative{};
  for (int first = 0; job.past && first < job.padded; first += P::kWidth) carry_on<G, P>(job, first);
  for (int first = 0; first < job.padded; first += P::kWidth) evaluate_bundle(job, first, impulse, relative);
  double p[P::kWidth], r[P::kWidth];
  impulse.store(p), relative.store(r);
  double largest = p[0];
  job.relative = r[0];
  for (int i = 1; i < P::kWidth; ++i) {
    if (!(p[i] <= largest)) largest = p[i];
    if (!(r[i] <= job.relative)) job.relative = r[i];
  }
  job.torque_Nm = largest / job.h;
}

}  // namespace hamel::dynamics
