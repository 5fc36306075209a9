#pragma once
/// Space as the recursions see it: SE(3) with twists and wrenches in each link's own axes.
///
/// planar.h offers the same functions for SE(2).  Every function is given the joint's constants k and the
/// frame X of its link; S is one number, or one per lane.

#include <cmath>
#include <vector>

#include "common/lie/pack.h"
#include "common/rbd/axis_chain.h"

namespace hamel::rbd {

using lie::Mat3;
using lie::Sym3;
using lie::Vec3;

/// Angular and linear half of a twist, momentum or wrench.
template <class S>
struct Half6 {
  Vec3<S> a, l;
};
/// Pose of a link's frame in its parent's.
template <class S>
struct LinkPose {
  Mat3<S> R;
  Vec3<S> p;
};
/// Articulated inertia [[J, H], [H^T, M]].
template <class S>
struct Articulated {
  Sym3<S> J, M;
  Mat3<S> H;
};

/// What the recursions are written over.
struct SE3 {
  static constexpr bool kPlanar = false;
  using Chain = AxisChain;
  using Link = AxisLink;
  template <class S>
  using Motion = Half6<S>;
  template <class S>
  using Frame = LinkPose<S>;
  template <class S>
  using Direction = Vec3<S>;
  template <class S>
  using Inertia = Articulated<S>;
  template <class S>
  using Attitude = Mat3<S>;  ///< of a link in the world
};

template <class S>
[[gnu::always_inline]] inline Half6<S> operator+(const Half6<S>& x, const Half6<S>& y) {
  return {x.a + y.a, x.l + y.l};
}
template <class S>
[[gnu::always_inline]] inline Half6<S> operator-(const Half6<S>& x, const Half6<S>& y) {
  return {x.a - y.a, x.l - y.l};
}
template <class A, class S>
[[gnu::always_inline]] inline Half6<lie::Prod<A, S>> operator*(const A& s, const Half6<S>& x) {
  return {s * x.a, s * x.l};
}
template <class S>
[[gnu::always_inline]] inline S dot(const Half6<S>& F, const Half6<S>& V) {
  return dot(F.a, V.a) + dot(F.l, V.l);
}

/// A: unit twist of the joint.
template <class S>
[[gnu::always_inline]] inline Half6<S> joint_axis(const AxisLink& k, const LinkPose<S>&) {
  const Vec3<S> zero{}, z{S{}, S{}, S{} + 1.0};
  return k.prismatic ? Half6<S>{zero, z} : Half6<S>{z, zero};
}
/// A^T F: the component along the joint.
template <class S>
[[gnu::always_inline]] inline S along(const AxisLink& k, const LinkPose<S>&, const Half6<S>& F) {
  return k.prismatic ? F.l.z : F.a.z;
}
/// V + A x.
template <class S>
[[gnu::always_inline]] inline void add_along(const AxisLink& k, const LinkPose<S>&, Half6<S>& V, const S& x) {
  S& z = k.prismatic ? V.l.z : V.a.z;
  z = z + x;
}

/// X_PB(q) = X_PJ exp(A q), Eq. (3).
template <class S>
[[gnu::always_inline]] inline LinkPose<S> pose_at(const AxisLink& k, const S& q) {
  const Mat3<double>& R = k.R_PJ;
  const S one = q * 0.0 + 1.0;
  if (k.prismatic) return {{one * R.x, one * R.y, one * R.z}, one * k.p_PJ + q * R.z};
  S s, c;
  lie::sincos(q, s, c);
  return {{c * R.x + s * R.y, c * R.y - s * R.x, one * R.z}, one * k.p_PJ};
}
/// All frames at q.
template <class S>
[[gnu::always_inline]] inline void place(const AxisChain& chain, const S* q, LinkPose<S>* X) noexcept {
  for (int i = 0; i < chain.n(); ++i) X[i] = pose_at(chain[i], q[i]);
}

/// X V: a twist of the parent in the child's frame.
template <class S>
[[gnu::always_inline]] inline Half6<S> to_child(const LinkPose<S>& X, const Half6<S>& V) {
  return {transpose_times(X.R, V.a), transpose_times(X.R, V.l + cross(V.a, X.p))};
}
/// X^T F: a wrench on the child in the parent's frame.
template <class S>
[[gnu::always_inline]] inline Half6<S> to_parent(const LinkPose<S>& X, const Half6<S>& F) {
  const Vec3<S> f = X.R * F.l;
  return {X.R * F.a + cross(X.p, f), f};
}
/// A direction of the parent in the child's axes.
template <class S>
[[gnu::always_inline]] inline Vec3<S> turn_to_child(const LinkPose<S>& X, const Vec3<S>& g) {
  return transpose_times(X.R, g);
}
/// The twist of a link at frame X, as the link itself would have it at frame Y.
template <class S>
[[gnu::always_inline]] inline Half6<S> carried(const LinkPose<S>&, const LinkPose<S>&, const Half6<S>& V) {
  return V;
}
/// Attitude of a link in the world from its parent's (null: the world), and a world wrench in the link's
/// axes.
template <class S>
[[gnu::always_inline]] inline Mat3<S> attitude(const LinkPose<S>& X, const Mat3<S>* parent) {
  return parent ? *parent * X.R : X.R;
}
template <class S>
[[gnu::always_inline]] inline void add_in_link_axes(const Mat3<S>& R, const Half6<double>& F_W, Half6<S>& F) {
  F = F + Half6<S>{transpose_times(R, F_W.a), transpose_times(R, F_W.l)};
}
/// I V: momentum of a link.
template <class S>
[[gnu::always_inline]] inline Half6<S> momentum(const AxisLink& k, const LinkPose<S>&, const Half6<S>& V) {
  return {k.I_o * V.a + cross(k.h, V.l), k.mass * V.l + cross(V.a, k.h)};
}
/// ad_V^T F.
template <class S>
[[gnu::always_inline]] inline Half6<S> coadjoint(const Half6<S>& V, const Half6<S>& F) {
  return {cross(F.a, V.a) + cross(F.l, V.l), cross(F.l, V.a)};
}
/// A^T ad_V^T F, without the rest of it.
template <class S>
[[gnu::always_inline]] inline S coadjoint_along(const AxisLink& k, const LinkPose<S>&, const Half6<S>& V,
                                                const Half6<S>& F) {
  const S of_l = F.l.x * V.a.y - F.l.y * V.a.x;
  return k.prismatic ? of_l : F.a.x * V.a.y - F.a.y * V.a.x + F.l.x * V.l.y - F.l.y * V.l.x;
}
/// ad_V A qd = [V, A] qd: how the joint's motion turns the parent's twist.
template <class S>
[[gnu::always_inline]] inline Half6<S> bracket_with_axis(const AxisLink& k, const LinkPose<S>&,
                                                         const Half6<S>& V, const S& qd) {
  const Vec3<S> turn{V.a.y * qd, V.a.x * -qd, qd * 0.0};
  if (k.prismatic) return {{qd * 0.0, qd * 0.0, qd * 0.0}, turn};
  return {turn, {V.l.y * qd, V.l.x * -qd, qd * 0.0}};
}
/// The twist of a base that accelerates against gravity g: the classic trick of the recursions.
template <class S>
[[gnu::always_inline]] inline Half6<S> rising(const Vec3<S>& g) {
  return {{}, {-g.x, -g.y, -g.z}};
}

/// Composite first moment m of mass, gathered from the tip: this link's share, the way to the parent.
template <class S>
[[gnu::always_inline]] inline void add_moment(const AxisLink& k, const LinkPose<S>&, Vec3<S>& m) {
  m = m + k.h;
}
template <class S>
[[gnu::always_inline]] inline Vec3<S> moment_to_parent(const AxisLink& k, const LinkPose<S>& X,
                                                       const Vec3<S>& m) {
  return X.R * m + k.outer_mass * X.p;
}
/// A^T w for the composite gravity wrench w = (m x g, mass g).
template <class S>
[[gnu::always_inline]] inline S weight_along(const AxisLink& k, const LinkPose<S>&, const Vec3<S>& m,
                                             const Vec3<S>& g) {
  return k.prismatic ? k.outer_mass * g.z : m.x * g.y - m.y * g.x;
}
/// Gravity wrench (h x g, m g) of one link for gravity g in its frame.
template <class S>
[[gnu::always_inline]] inline Half6<S> gravity_wrench(const AxisLink& k, const LinkPose<S>&,
                                                      const Vec3<S>& g) {
  return {cross(k.h, g), k.mass * g};
}

/// Adds link k's own inertia.
template <class S>
[[gnu::always_inline]] inline void add_rigid(const AxisLink& k, const LinkPose<S>&, Articulated<S>& I) {
  I.J.xx += k.I_o.xx, I.J.yy += k.I_o.yy, I.J.zz += k.I_o.zz;
  I.J.xy += k.I_o.xy, I.J.xz += k.I_o.xz, I.J.yz += k.I_o.yz;
  I.M.xx += k.mass, I.M.yy += k.mass, I.M.zz += k.mass;
  I.H.x.y += k.h.z, I.H.x.z -= k.h.y, I.H.y.x -= k.h.z;  // hat(h)
  I.H.y.z += k.h.x, I.H.z.x += k.h.y, I.H.z.y -= k.h.x;
}
/// I^A A: the joint's column of the articulated inertia.
template <class S>
[[gnu::always_inline]] inline Half6<S> joint_column(const AxisLink& k, const LinkPose<S>&,
                                                    const Articulated<S>& I) {
  if (k.prismatic) return {I.H.z, {I.M.xz, I.M.yz, I.M.zz}};
  return {{I.J.xz, I.J.yz, I.J.zz}, {I.H.x.z, I.H.y.z, I.H.z.z}};
}
/// I^a = I^A - W U^T, W = U / D.
template <class S>
[[gnu::always_inline]] inline Articulated<S> deflate(const Articulated<S>& I, const Half6<S>& W,
                                                     const Half6<S>& U) {
  return {minus_outer(I.J, W.a, U.a), minus_outer(I.M, W.l, U.l), minus_outer(I.H, W.a, U.l)};
}
/// X^T I X: the inertia seen from the parent.  With H' = R H R^T, M' = R M R^T and K = H' + hat(p) M' / 2:
/// H_P = H' + hat(p) M', J_P = R J R^T + W + W^T with W = hat(p) K^T.
template <class S>
[[gnu::always_inline]] inline Articulated<S> to_parent(const LinkPose<S>& X, const Articulated<S>& I) {
  const Sym3<S> M = rotate(X.R, I.M);
  const Mat3<S> H = rotate(X.R, I.H), pM = cross(X.p, M);
  const Mat3<S> K{H.x + 0.5 * pM.x, H.y + 0.5 * pM.y, H.z + 0.5 * pM.z};
  return {rotate(X.R, I.J) + twice_symmetric(cross(X.p, transpose(K))), M, H + pM};
}

}  // namespace hamel::rbd
