#pragma once
/// The recursions along an AxisChain, over any scalar S: one number, or one per lane.
///
/// A frame's pose in its parent is (R, p).  Twists and wrenches are split into angular and linear halves.

#include <cmath>

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
template <class S>
inline Half6<S> operator+(const Half6<S>& x, const Half6<S>& y) {
  return {x.a + y.a, x.l + y.l};
}
template <class S>
inline Half6<S> operator-(const Half6<S>& x, const Half6<S>& y) {
  return {x.a - y.a, x.l - y.l};
}
template <class A, class S>
inline Half6<lie::Prod<A, S>> operator*(const A& s, const Half6<S>& x) {
  return {s * x.a, s * x.l};
}

/// A^T F: the component along the joint.
template <class S>
inline const S& along(const AxisLink& link, const Half6<S>& F) {
  return link.prismatic ? F.l.z : F.a.z;
}
template <class S>
inline S& along(const AxisLink& link, Half6<S>& F) {
  return link.prismatic ? F.l.z : F.a.z;
}

template <class S>
struct LinkPose {
  Mat3<S> R;
  Vec3<S> p;
};
/// X_PB(q) = X_PJ exp(A q), Eq. (3), from the sine and cosine of q (unused by a prismatic joint).
template <class S>
inline LinkPose<S> pose_at(const AxisLink& k, const S& q, const S& sin_q, const S& cos_q) {
  const Mat3<double>& R = k.R_PJ;
  if (k.prismatic) {
    const S one = q * 0.0 + 1.0;
    return {{one * R.x, one * R.y, one * R.z}, one * k.p_PJ + q * R.z};
  }
  const S one = cos_q * 0.0 + 1.0;
  return {{cos_q * R.x + sin_q * R.y, cos_q * R.y - sin_q * R.x, one * R.z}, one * k.p_PJ};
}
inline LinkPose<double> pose_at(const AxisLink& k, double q) {
  if (k.prismatic) return {k.R_PJ, k.p_PJ + q * k.R_PJ.z};
  const double s = std::sin(q), c = std::cos(q);
  return {{c * k.R_PJ.x + s * k.R_PJ.y, c * k.R_PJ.y - s * k.R_PJ.x, k.R_PJ.z}, k.p_PJ};
}

/// X V: a twist of the parent in the child's frame.
template <class S>
inline Half6<S> to_child(const LinkPose<S>& X, const Half6<S>& V) {
  return {transpose_times(X.R, V.a), transpose_times(X.R, V.l + cross(V.a, X.p))};
}
/// X^T F: a wrench on the child in the parent's frame.
template <class S>
inline Half6<S> to_parent(const LinkPose<S>& X, const Half6<S>& F) {
  const Vec3<S> f = X.R * F.l;
  return {X.R * F.a + cross(X.p, f), f};
}
/// I V: momentum of a link.
template <class S>
inline Half6<S> momentum(const AxisLink& k, const Half6<S>& V) {
  return {k.I_o * V.a + cross(k.h, V.l), k.mass * V.l + cross(V.a, k.h)};
}
/// ad_V^T F.
template <class S>
inline Half6<S> coadjoint(const Half6<S>& V, const Half6<S>& F) {
  return {cross(F.a, V.a) + cross(F.l, V.l), cross(F.l, V.a)};
}
/// A^T ad_V^T F, without the rest of it.
template <class S>
inline S coadjoint_along(const AxisLink& k, const Half6<S>& V, const Half6<S>& F) {
  const S of_l = F.l.x * V.a.y - F.l.y * V.a.x;
  return k.prismatic ? of_l : F.a.x * V.a.y - F.a.y * V.a.x + F.l.x * V.l.y - F.l.y * V.l.x;
}
/// ad_V A qd = [V, A] qd: how the joint's motion turns the parent's twist.
template <class S>
inline Half6<S> bracket_with_axis(const AxisLink& k, const Half6<S>& V, const S& qd) {
  const Vec3<S> turn{V.a.y * qd, V.a.x * -qd, qd * 0.0};
  if (k.prismatic) return {{qd * 0.0, qd * 0.0, qd * 0.0}, turn};
  return {turn, {V.l.y * qd, V.l.x * -qd, qd * 0.0}};
}
/// Gravity wrench (h x g, m g) for gravity g in the link's frame.
template <class S>
inline Half6<S> gravity_wrench(const AxisLink& k, const Vec3<S>& g) {
  return {cross(k.h, g), k.mass * g};
}

/// Articulated inertia [[J, H], [H^T, M]].
template <class S>
struct Articulated {
  Sym3<S> J, M;
  Mat3<S> H;
};
/// What one joint keeps of the articulated-body factorisation.
template <class S>
struct JointFactor {
  Half6<S> U;  ///< I^A A
  S D_inv{};   ///< 1 / (A^T I^A A + armature + extra)
};

/// Adds link k's own inertia.
template <class S>
inline void add_rigid(const AxisLink& k, Articulated<S>& I) {
  I.J.xx += k.I_o.xx, I.J.yy += k.I_o.yy, I.J.zz += k.I_o.zz;
  I.J.xy += k.I_o.xy, I.J.xz += k.I_o.xz, I.J.yz += k.I_o.yz;
  I.M.xx += k.mass, I.M.yy += k.mass, I.M.zz += k.mass;
  I.H.x.y += k.h.z, I.H.x.z -= k.h.y, I.H.y.x -= k.h.z;  // hat(h)
  I.H.y.z += k.h.x, I.H.z.x += k.h.y, I.H.z.y -= k.h.x;
}
/// I^A A: the joint's column of the articulated inertia.
template <class S>
inline Half6<S> joint_column(const AxisLink& k, const Articulated<S>& I) {
  if (k.prismatic) return {I.H.z, {I.M.xz, I.M.yz, I.M.zz}};
  return {{I.J.xz, I.J.yz, I.J.zz}, {I.H.x.z, I.H.y.z, I.H.z.z}};
}
/// I^a = I^A - U U^T / D.
template <class S>
inline Articulated<S> deflate(const Articulated<S>& I, const JointFactor<S>& f) {
  return {minus_outer(I.J, f.D_inv, f.U.a), minus_outer(I.M, f.D_inv, f.U.l),
          minus_outer(I.H, f.D_inv, f.U.a, f.U.l)};
}
/// X^T I X: the inertia seen from the parent.  With H' = R H R^T, M' = R M R^T and K = H' + hat(p) M' / 2:
/// H_P = H' + hat(p) M', J_P = R J R^T + W + W^T with W = hat(p) K^T.
template <class S>
inline Articulated<S> to_parent(const LinkPose<S>& X, const Articulated<S>& I) {
  const Sym3<S> M = rotate(X.R, I.M);
  const Mat3<S> H = rotate(X.R, I.H), pM = cross(X.p, M);
  const Mat3<S> K{H.x + 0.5 * pM.x, H.y + 0.5 * pM.y, H.z + 0.5 * pM.z};
  return {rotate(X.R, I.J) + twice_symmetric(cross(X.p, transpose(K))), M, H + pM};
}
/// I V for an articulated inertia.
template <class S>
inline Half6<S> times(const Articulated<S>& I, const Half6<S>& V) {
  return {I.J * V.a + I.H * V.l, transpose_times(I.H, V.a) + I.M * V.l};
}

/// Articulated-body factorisation of M(q) + diag(extra), O(n).  `extra` may be null.
template <class S>
void factorise(const AxisChain& chain, const LinkPose<S>* X, const S* extra, JointFactor<S>* f) noexcept {
  Articulated<S> I{};
  for (int i = chain.n(); i-- > 0;) {
    const AxisLink& k = chain[i];
    add_rigid(k, I);
    f[i].U = joint_column(k, I);
    S D = along(k, f[i].U) + k.armature;
    if (extra) D += extra[i];
    f[i].D_inv = 1.0 / D;
    if (i > 0) I = to_parent(X[i], deflate(I, f[i]));
  }
}
/// x = (M + diag(extra))^-1 (b - A^T W) from the factorisation, O(n), where W_i is the sum of the wrenches `wrench`
/// of link i and all beyond it (null: none).  x and b may be the same; `u` is scratch.
template <class S>
void solve(const AxisChain& chain, const LinkPose<S>* X, const JointFactor<S>* f, const S* b, S* u, S* x,
           const Half6<S>* wrench = nullptr) noexcept {
  Half6<S> p{};
  for (int i = chain.n(); i-- > 0;) {
    const AxisLink& k = chain[i];
    if (wrench) p = p + wrench[i];
    u[i] = (b[i] - along(k, p)) * f[i].D_inv;
    if (i > 0) p = to_parent(X[i], p + u[i] * f[i].U);
  }
  Half6<S> a{};
  for (int i = 0; i < chain.n(); ++i) {
    const AxisLink& k = chain[i];
    if (i > 0) a = to_child(X[i], a);
    x[i] = u[i] - f[i].D_inv * (dot(f[i].U.a, a.a) + dot(f[i].U.l, a.l));
    along(k, a) += x[i];
  }
}

}  // namespace hamel::rbd
