#pragma once
/// The plane as the recursions see it: SE(2), the functions of spatial.h once more.
///
/// All links' frames keep the plane's own axes and only their origins move: a change of coordinates at each
/// configuration, after which twists and wrenches pass from link to link by a translation alone.  What turns
/// is in the frame: offset, first moment, prismatic axis.

#include <cmath>

#include "common/lie/pack.h"
#include "common/rbd/planar_chain.h"

namespace hamel::rbd {

using lie::Sym2;
using lie::Vec2;

/// Angular and linear part of a twist, momentum or wrench.
template <class S>
struct Half3 {
  S a{};
  Vec2<S> l;
};
/// A link at a configuration, in the plane's axes.
template <class S>
struct PlanarFrame {
  S c{}, s{};  ///< cosine and sine of the link's angle
  Vec2<S> p;   ///< from the parent's origin to this one
  Vec2<S> h;   ///< mass times centre of mass
};
/// Articulated inertia [[J, H^T], [H, M]].
template <class S>
struct PlanarArticulated {
  S J{};
  Vec2<S> H;
  Sym2<S> M;
};

struct NoAttitude {};

struct SE2 {
  static constexpr bool kPlanar = true;
  using Chain = PlanarChain;
  using Link = PlanarLink;
  template <class S>
  using Motion = Half3<S>;
  template <class S>
  using Frame = PlanarFrame<S>;
  template <class S>
  using Direction = Vec2<S>;
  template <class S>
  using Inertia = PlanarArticulated<S>;
  template <class S>
  using Attitude = NoAttitude;
};

template <class S>
[[gnu::always_inline]] inline Half3<S> operator+(const Half3<S>& x, const Half3<S>& y) {
  return {x.a + y.a, x.l + y.l};
}
template <class S>
[[gnu::always_inline]] inline Half3<S> operator-(const Half3<S>& x, const Half3<S>& y) {
  return {x.a - y.a, x.l - y.l};
}
template <class A, class S>
[[gnu::always_inline]] inline Half3<lie::Prod<A, S>> operator*(const A& s, const Half3<S>& x) {
  return {s * x.a, s * x.l};
}
template <class S>
[[gnu::always_inline]] inline S dot(const Half3<S>& F, const Half3<S>& V) {
  return F.a * V.a + dot(F.l, V.l);
}

/// Direction of a prismatic joint.
template <class S>
[[gnu::always_inline]] inline Vec2<S> axis(const PlanarLink& k, const PlanarFrame<S>& X) {
  return rotate(X.c, X.s, k.axis);
}
template <class S>
[[gnu::always_inline]] inline Half3<S> joint_axis(const PlanarLink& k, const PlanarFrame<S>& X) {
  return k.prismatic ? Half3<S>{S{}, axis(k, X)} : Half3<S>{S{} + k.sign, {}};
}
template <class S>
[[gnu::always_inline]] inline S along(const PlanarLink& k, const PlanarFrame<S>& X, const Half3<S>& F) {
  return k.prismatic ? dot(axis(k, X), F.l) : k.sign * F.a;
}
template <class S>
[[gnu::always_inline]] inline void add_along(const PlanarLink& k, const PlanarFrame<S>& X, Half3<S>& V,
                                             const S& x) {
  if (k.prismatic) {
    V.l = V.l + x * axis(k, X);
  } else {
    V.a = V.a + k.sign * x;
  }
}

/// Turns vectors by one angle; numbers alone both components at a time.
template <class S>
struct Turn {
  S c, s;
  [[gnu::always_inline]] Vec2<S> operator()(const Vec2<double>& v) const { return rotate(c, s, v); }
};
template <>
struct Turn<double> {
  using Pair = lie::Pack<2, lie::Baseline>;
  Pair c, s;
  [[gnu::always_inline]] Turn(double cosine, double sine) : c{{cosine, cosine}}, s{{-sine, sine}} {}
  [[gnu::always_inline]] Vec2<double> operator()(const Vec2<double>& v) const {
    const Pair turned = c * Pair{{v.x, v.y}} + s * Pair{{v.y, v.x}};
    return {turned.v[0], turned.v[1]};
  }
};

/// Sines and cosines of all links, whose frames keep their angles in c until then: numbers alone are turned
/// two at a time.
template <class S>
[[gnu::always_inline]] inline void turn_all(int n, PlanarFrame<S>* X) noexcept {
  for (int i = 0; i < n; ++i) lie::sincos(S(X[i].c), X[i].s, X[i].c);
}
[[gnu::always_inline]] inline void turn_all(int n, PlanarFrame<double>* X) noexcept {
  using Pair = lie::Pack<2, lie::Baseline>;
  for (int i = 0; i < n; i += 2) {
    PlanarFrame<double>&x = X[i], &y = X[i + 1 < n ? i + 1 : i];
    Pair s, c;
    lie::sincos(Pair{{x.c, y.c}}, s, c);
    x.c = c.v[0], x.s = s.v[0], y.c = c.v[1], y.s = s.v[1];
  }
}
/// What sine and cosine of a link turn: its own first moment and the way to the next origin.
template <class S>
[[gnu::always_inline]] inline void put_together(const PlanarChain& chain, const S* q,
                                                PlanarFrame<S>* X) noexcept {
  Turn<S> turn{S{} + 1.0, S{}};
  for (int i = 0; i < chain.n(); ++i) {
    const PlanarLink& k = chain[i];
    X[i].p = turn(k.p_PJ);
    if (k.prismatic) X[i].p = X[i].p + q[i] * turn(k.axis);
    turn = Turn<S>{X[i].c, X[i].s};
    X[i].h = turn(k.h);
  }
}
/// All frames at q: angles add up along the chain, and each is turned into one sine and cosine.
template <class S>
[[gnu::always_inline]] inline void place(const PlanarChain& chain, const S* q, PlanarFrame<S>* X) noexcept {
  S angle{};
  for (int i = 0; i < chain.n(); ++i) {
    if (!chain[i].prismatic) angle = angle + chain[i].sign * q[i];
    X[i].c = angle;
  }
  turn_all(chain.n(), X);
  put_together(chain, q, X);
}
/// Angles that turn_on() takes on by their series: what it leaves out is below angle^4 / 24 = 5e-18 [rad].
inline constexpr double kTurnOn = 1e-4;
/// All frames at q from those where joint i was at q_i - change(i), at a fraction of the cost of place().
/// False, and X means nothing, where the links' turns add up to kTurnOn or more.
template <class Change>
[[gnu::always_inline]] inline bool turn_on(const PlanarChain& chain, const double* q, const Change& change,
                                           PlanarFrame<double>* X) noexcept {
  double angle = 0, sum = 0;
  for (int i = 0; i < chain.n(); ++i) {
    if (!chain[i].prismatic) angle += chain[i].sign * change(i);
    sum += std::abs(angle);
    const double c = X[i].c, s = X[i].s, half = 0.5 * angle, third = (1.0 / 3) * angle;
    X[i].c = c - angle * (s + half * (c - third * s));
    X[i].s = s + angle * (c - half * (s + third * c));
  }
  if (!(sum < kTurnOn)) return false;
  put_together(chain, q, X);
  return true;
}

template <class S>
[[gnu::always_inline]] inline Half3<S> to_child(const PlanarFrame<S>& X, const Half3<S>& V) {
  return {V.a, V.l + turned(V.a, X.p)};
}
template <class S>
[[gnu::always_inline]] inline Half3<S> to_parent(const PlanarFrame<S>& X, const Half3<S>& F) {
  return {F.a + cross(X.p, F.l), F.l};
}
template <class S>
[[gnu::always_inline]] inline Vec2<S> turn_to_child(const PlanarFrame<S>&, const Vec2<S>& g) {
  return g;
}
/// The twist of a link at frame X, as the link itself would have it at frame Y.
template <class S>
[[gnu::always_inline]] inline Half3<S> carried(const PlanarFrame<S>& X, const PlanarFrame<S>& Y,
                                               const Half3<S>& V) {
  return {V.a, rotate(Y.c, Y.s, rotate(X.c, -X.s, V.l))};
}
template <class S>
[[gnu::always_inline]] inline NoAttitude attitude(const PlanarFrame<S>&, const NoAttitude*) {
  return {};
}
template <class S>
[[gnu::always_inline]] inline void add_in_link_axes(NoAttitude, const Half3<double>& F_E, Half3<S>& F) {
  F.a = F.a + F_E.a;
  F.l.x = F.l.x + F_E.l.x, F.l.y = F.l.y + F_E.l.y;
}
template <class S>
[[gnu::always_inline]] inline Half3<S> momentum(const PlanarLink& k, const PlanarFrame<S>& X,
                                                const Half3<S>& V) {
  return {k.I_o * V.a + cross(X.h, V.l), k.mass * V.l + turned(V.a, X.h)};
}
template <class S>
[[gnu::always_inline]] inline Half3<S> coadjoint(const Half3<S>& V, const Half3<S>& F) {
  return {cross(F.l, V.l), {F.l.y * V.a, -(F.l.x * V.a)}};
}
template <class S>
[[gnu::always_inline]] inline S coadjoint_along(const PlanarLink& k, const PlanarFrame<S>& X,
                                                const Half3<S>& V, const Half3<S>& F) {
  return k.prismatic ? V.a * cross(axis(k, X), F.l) : k.sign * cross(F.l, V.l);
}
template <class S>
[[gnu::always_inline]] inline Half3<S> bracket_with_axis(const PlanarLink& k, const PlanarFrame<S>& X,
                                                         const Half3<S>& V, const S& qd) {
  if (k.prismatic) return {qd * 0.0, turned(V.a * qd, axis(k, X))};
  return {qd * 0.0, turned(-(k.sign * qd), V.l)};
}
template <class S>
[[gnu::always_inline]] inline Half3<S> rising(const Vec2<S>& g) {
  return {{}, {-g.x, -g.y}};
}

template <class S>
[[gnu::always_inline]] inline void add_moment(const PlanarLink&, const PlanarFrame<S>& X, Vec2<S>& m) {
  m = m + X.h;
}
template <class S>
[[gnu::always_inline]] inline Vec2<S> moment_to_parent(const PlanarLink& k, const PlanarFrame<S>& X,
                                                       const Vec2<S>& m) {
  return m + k.outer_mass * X.p;
}
template <class S>
[[gnu::always_inline]] inline S weight_along(const PlanarLink& k, const PlanarFrame<S>& X, const Vec2<S>& m,
                                             const Vec2<S>& g) {
  return k.prismatic ? k.outer_mass * dot(axis(k, X), g) : k.sign * cross(m, g);
}
template <class S>
[[gnu::always_inline]] inline Half3<S> gravity_wrench(const PlanarLink& k, const PlanarFrame<S>& X,
                                                      const Vec2<S>& g) {
  return {cross(X.h, g), k.mass * g};
}

template <class S>
[[gnu::always_inline]] inline void add_rigid(const PlanarLink& k, const PlanarFrame<S>& X,
                                             PlanarArticulated<S>& I) {
  I.J = I.J + k.I_o;
  I.H.x = I.H.x - X.h.y, I.H.y = I.H.y + X.h.x;
  I.M.xx = I.M.xx + k.mass, I.M.yy = I.M.yy + k.mass;
}
template <class S>
[[gnu::always_inline]] inline Half3<S> joint_column(const PlanarLink& k, const PlanarFrame<S>& X,
                                                    const PlanarArticulated<S>& I) {
  if (k.prismatic) return {dot(I.H, axis(k, X)), I.M * axis(k, X)};
  return {k.sign * I.J, k.sign * I.H};
}
template <class S>
[[gnu::always_inline]] inline PlanarArticulated<S> deflate(const PlanarArticulated<S>& I, const Half3<S>& W,
                                                           const Half3<S>& U) {
  return {I.J - W.a * U.a,
          {I.H.x - W.a * U.l.x, I.H.y - W.a * U.l.y},
          {I.M.xx - W.l.x * U.l.x, I.M.yy - W.l.y * U.l.y, I.M.xy - W.l.x * U.l.y}};
}
/// The origin moves by -p.  With c = e_3 x p: H_P = H + M c, J_P = J + c . (H + H_P).
template <class S>
[[gnu::always_inline]] inline PlanarArticulated<S> to_parent(const PlanarFrame<S>& X,
                                                             const PlanarArticulated<S>& I) {
  const Vec2<S> c{-X.p.y, X.p.x}, H = I.H + I.M * c;
  return {I.J + dot(c, I.H + H), H, I.M};
}

}  // namespace hamel::rbd
