#pragma once
/// Two-vectors and rotations of the plane, of any scalar: vec3.h's siblings.

#include "common/lie/vec3.h"

namespace hamel::lie {

template <class S>
struct Vec2 {
  S x{}, y{};
};
/// Symmetric 2 x 2.
template <class S>
struct Sym2 {
  S xx{}, yy{}, xy{};
};

template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> operator+(const Vec2<A>& a, const Vec2<B>& b) {
  return {a.x + b.x, a.y + b.y};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> operator-(const Vec2<A>& a, const Vec2<B>& b) {
  return {a.x - b.x, a.y - b.y};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> operator*(const A& s, const Vec2<B>& b) {
  return {s * b.x, s * b.y};
}
template <class S>
[[gnu::always_inline]] inline Vec2<S>& operator+=(Vec2<S>& a, const Vec2<S>& b) {
  return a = a + b;
}
template <class A, class B>
[[gnu::always_inline]] inline Prod<A, B> dot(const Vec2<A>& a, const Vec2<B>& b) {
  return a.x * b.x + a.y * b.y;
}
/// The one component of the cross product.
template <class A, class B>
[[gnu::always_inline]] inline Prod<A, B> cross(const Vec2<A>& a, const Vec2<B>& b) {
  return a.x * b.y - a.y * b.x;
}
/// w e_3 x a: a quarter turn, times w.
template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> turned(const A& w, const Vec2<B>& a) {
  return {-(w * a.y), w * a.x};
}
/// a in axes turned by the angle of cosine c and sine s.
template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> rotate(const A& c, const A& s, const Vec2<B>& a) {
  return {c * a.x - s * a.y, s * a.x + c * a.y};
}
template <class A, class B>
[[gnu::always_inline]] inline Vec2<Prod<A, B>> operator*(const Sym2<A>& M, const Vec2<B>& b) {
  return {M.xx * b.x + M.xy * b.y, M.xy * b.x + M.yy * b.y};
}

}  // namespace hamel::lie
