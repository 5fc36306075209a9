#pragma once
/// Three-vectors and 3 x 3 matrices of any scalar that has + - * /: a double, or a pack of doubles side by
/// side.
///
/// The recursions are written once over these.  Plain structs: everything inlines, nothing allocates.
/// Products of a constant of doubles and a variable of packs give packs.

#include <Eigen/Core>

namespace hamel::lie {

template <class S>
struct Vec3 {
  S x{}, y{}, z{};
};
/// By columns: M = [x y z].
template <class S>
struct Mat3 {
  Vec3<S> x, y, z;
};
/// Symmetric 3 x 3.
template <class S>
struct Sym3 {
  S xx{}, yy{}, zz{}, xy{}, xz{}, yz{};
};

template <class A, class B>
using Prod = decltype(A{} * B{});

template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> operator+(const Vec3<A>& a, const Vec3<B>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> operator-(const Vec3<A>& a, const Vec3<B>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> operator*(const A& s, const Vec3<B>& b) {
  return {s * b.x, s * b.y, s * b.z};
}
template <class S>
[[gnu::always_inline]] inline Vec3<S>& operator+=(Vec3<S>& a, const Vec3<S>& b) {
  return a = a + b;
}
template <class S>
[[gnu::always_inline]] inline Vec3<S>& operator-=(Vec3<S>& a, const Vec3<S>& b) {
  return a = a - b;
}

template <class A, class B>
[[gnu::always_inline]] inline Prod<A, B> dot(const Vec3<A>& a, const Vec3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> cross(const Vec3<A>& a, const Vec3<B>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> operator*(const Mat3<A>& M, const Vec3<B>& b) {
  return {M.x.x * b.x + M.y.x * b.y + M.z.x * b.z, M.x.y * b.x + M.y.y * b.y + M.z.y * b.z,
          M.x.z * b.x + M.y.z * b.y + M.z.z * b.z};
}
/// M^T b.
template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> transpose_times(const Mat3<A>& M, const Vec3<B>& b) {
  return {dot(M.x, b), dot(M.y, b), dot(M.z, b)};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec3<Prod<A, B>> operator*(const Sym3<A>& M, const Vec3<B>& b) {
  return {M.xx * b.x + M.xy * b.y + M.xz * b.z, M.xy * b.x + M.yy * b.y + M.yz * b.z,
          M.xz * b.x + M.yz * b.y + M.zz * b.z};
}
template <class A, class B>
[[gnu::always_inline]] inline Mat3<Prod<A, B>> operator*(const Mat3<A>& M, const Mat3<B>& N) {
  return {M * N.x, M * N.y, M * N.z};
}
template <class S>
[[gnu::always_inline]] inline Mat3<S> operator+(const Mat3<S>& M, const Mat3<S>& N) {
  return {M.x + N.x, M.y + N.y, M.z + N.z};
}
template <class S>
[[gnu::always_inline]] inline Sym3<S> operator+(const Sym3<S>& M, const Sym3<S>& N) {
  return {M.xx + N.xx, M.yy + N.yy, M.zz + N.zz, M.xy + N.xy, M.xz + N.xz, M.yz + N.yz};
}
template <class S>
[[gnu::always_inline]] inline Sym3<S>& operator+=(Sym3<S>& M, const Sym3<S>& N) {
  return M = M + N;
}
template <class S>
[[gnu::always_inline]] inline Mat3<S>& operator+=(Mat3<S>& M, const Mat3<S>& N) {
  return M = M + N;
}
template <class S>
[[gnu::always_inline]] inline Mat3<S> transpose(const Mat3<S>& M) {
  return {{M.x.x, M.y.x, M.z.x}, {M.x.y, M.y.y, M.z.y}, {M.x.z, M.y.z, M.z.z}};
}

/// hat(p) N: the columns p x n.
template <class A, class B>
[[gnu::always_inline]] inline Mat3<Prod<A, B>> cross(const Vec3<A>& p, const Mat3<B>& N) {
  return {cross(p, N.x), cross(p, N.y), cross(p, N.z)};
}
/// hat(p) M.
template <class A, class B>
[[gnu::always_inline]] inline Mat3<Prod<A, B>> cross(const Vec3<A>& p, const Sym3<B>& M) {
  return {cross(p, Vec3<B>{M.xx, M.xy, M.xz}), cross(p, Vec3<B>{M.xy, M.yy, M.yz}),
          cross(p, Vec3<B>{M.xz, M.yz, M.zz})};
}
/// W + W^T.
template <class S>
[[gnu::always_inline]] inline Sym3<S> twice_symmetric(const Mat3<S>& W) {
  return {W.x.x + W.x.x, W.y.y + W.y.y, W.z.z + W.z.z, W.y.x + W.x.y, W.z.x + W.x.z, W.z.y + W.y.z};
}
/// M - a b^T where a b^T is symmetric.
template <class S>
[[gnu::always_inline]] inline Sym3<S> minus_outer(const Sym3<S>& M, const Vec3<S>& a, const Vec3<S>& b) {
  return {M.xx - a.x * b.x, M.yy - a.y * b.y, M.zz - a.z * b.z,
          M.xy - a.x * b.y, M.xz - a.x * b.z, M.yz - a.y * b.z};
}
/// M - a b^T.
template <class S>
[[gnu::always_inline]] inline Mat3<S> minus_outer(const Mat3<S>& M, const Vec3<S>& a, const Vec3<S>& b) {
  return {M.x - b.x * a, M.y - b.y * a, M.z - b.z * a};
}
/// R M R^T for symmetric M.
template <class A, class B>
[[gnu::always_inline]] inline Sym3<Prod<A, B>> rotate(const Mat3<A>& R, const Sym3<B>& M) {
  using S = Prod<A, B>;
  const Vec3<S> tx = R * Vec3<B>{M.xx, M.xy, M.xz}, ty = R * Vec3<B>{M.xy, M.yy, M.yz},
                tz = R * Vec3<B>{M.xz, M.yz, M.zz};
  const auto at = [&](const S& a, const S& b, const S& c, const A& x, const A& y, const A& z) {
    return a * x + b * y + c * z;
  };
  return {at(tx.x, ty.x, tz.x, R.x.x, R.y.x, R.z.x), at(tx.y, ty.y, tz.y, R.x.y, R.y.y, R.z.y),
          at(tx.z, ty.z, tz.z, R.x.z, R.y.z, R.z.z), at(tx.x, ty.x, tz.x, R.x.y, R.y.y, R.z.y),
          at(tx.x, ty.x, tz.x, R.x.z, R.y.z, R.z.z), at(tx.y, ty.y, tz.y, R.x.z, R.y.z, R.z.z)};
}
/// R H R^T.
template <class A, class B>
[[gnu::always_inline]] inline Mat3<Prod<A, B>> rotate(const Mat3<A>& R, const Mat3<B>& H) {
  const auto T = R * H;  // R H, then times R^T: column j is sum_k T_k R_jk
  return {R.x.x * T.x + R.y.x * T.y + R.z.x * T.z, R.x.y * T.x + R.y.y * T.y + R.z.y * T.z,
          R.x.z * T.x + R.y.z * T.y + R.z.z * T.z};
}

/// hat(a).
[[gnu::always_inline]] inline Mat3<double> hat3(const Vec3<double>& a) {
  return {{0, a.z, -a.y}, {-a.z, 0, a.x}, {a.y, -a.x, 0}};
}
[[gnu::always_inline]] inline Mat3<double> full(const Sym3<double>& M) {
  return {{M.xx, M.xy, M.xz}, {M.xy, M.yy, M.yz}, {M.xz, M.yz, M.zz}};
}

[[gnu::always_inline]] inline Vec3<double> vec3(const Eigen::Vector3d& a) { return {a.x(), a.y(), a.z()}; }
[[gnu::always_inline]] inline Mat3<double> mat3(const Eigen::Matrix3d& M) {
  return {vec3(M.col(0)), vec3(M.col(1)), vec3(M.col(2))};
}
[[gnu::always_inline]] inline Sym3<double> sym3(const Eigen::Matrix3d& M) {
  return {M(0, 0),
          M(1, 1),
          M(2, 2),
          0.5 * (M(0, 1) + M(1, 0)),
          0.5 * (M(0, 2) + M(2, 0)),
          0.5 * (M(1, 2) + M(2, 1))};
}

}  // namespace hamel::lie
