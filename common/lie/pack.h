#pragma once
/// W numbers side by side, as a scalar of the recursions.
///
/// Every operation is the number's own in each lane and none mixes lanes: a lane gets the bits that a number
/// alone would get (kernels are compiled without contraction of products and sums).  Isa names the
/// instructions of the file that uses the pack, so that code for one processor is never taken for another's
/// of the same name.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "common/lie/sincos.h"

namespace hamel::lie {

/// The instructions every processor of the kind has.
struct Baseline {};

template <int W, class Isa>
struct Pack {
  typedef double Lanes __attribute__((vector_size(8 * W)));
  typedef std::int64_t Bits __attribute__((vector_size(8 * W)));
  static constexpr int kWidth = W;
  Lanes v{};

  [[gnu::always_inline]] static Pack of(double x) { return {x - Lanes{}}; }
  [[gnu::always_inline]] static Pack load(const double* p) {
    Pack x;
    std::memcpy(&x.v, p, sizeof x.v);
    return x;
  }
  [[gnu::always_inline]] void store(double* p) const { std::memcpy(p, &v, sizeof v); }

  [[gnu::always_inline]] friend Pack operator+(Pack a, Pack b) { return {a.v + b.v}; }
  [[gnu::always_inline]] friend Pack operator-(Pack a, Pack b) { return {a.v - b.v}; }
  [[gnu::always_inline]] friend Pack operator*(Pack a, Pack b) { return {a.v * b.v}; }
  [[gnu::always_inline]] friend Pack operator/(Pack a, Pack b) { return {a.v / b.v}; }
  [[gnu::always_inline]] friend Pack operator+(Pack a, double b) { return {a.v + b}; }
  [[gnu::always_inline]] friend Pack operator-(Pack a, double b) { return {a.v - b}; }
  [[gnu::always_inline]] friend Pack operator*(Pack a, double b) { return {a.v * b}; }
  [[gnu::always_inline]] friend Pack operator+(double a, Pack b) { return {a + b.v}; }
  [[gnu::always_inline]] friend Pack operator-(double a, Pack b) { return {a - b.v}; }
  [[gnu::always_inline]] friend Pack operator*(double a, Pack b) { return {a * b.v}; }
  [[gnu::always_inline]] friend Pack operator/(double a, Pack b) { return {a / b.v}; }
  [[gnu::always_inline]] Pack operator-() const { return {-v}; }
  [[gnu::always_inline]] Pack& operator+=(Pack b) { return v += b.v, *this; }
  [[gnu::always_inline]] Pack& operator-=(Pack b) { return v -= b.v, *this; }
  [[gnu::always_inline]] Pack& operator+=(double b) { return v += b, *this; }
  [[gnu::always_inline]] Pack& operator-=(double b) { return v -= b, *this; }

  [[gnu::always_inline]] friend Pack abs(Pack a) { return {(Lanes)((Bits)a.v & INT64_MAX)}; }
  /// The larger; b where a is not a number.
  [[gnu::always_inline]] friend Pack larger(Pack a, Pack b) { return {a.v > b.v ? a.v : b.v}; }
  [[gnu::always_inline]] friend Pack smaller(Pack a, Pack b) { return {a.v < b.v ? a.v : b.v}; }
};

/// True when every lane of x is a number below `bound`: halves upon halves.
template <int W, class Isa>
[[gnu::always_inline]] inline bool all_below(Pack<W, Isa> x, double bound) noexcept {
  typename Pack<W, Isa>::Bits below = x.v < bound;
  if constexpr (W == 8) below &= __builtin_shufflevector(below, below, 4, 5, 6, 7, 0, 1, 2, 3);
  if constexpr (W == 8) below &= __builtin_shufflevector(below, below, 2, 3, 0, 1, 6, 7, 4, 5);
  if constexpr (W == 4) below &= __builtin_shufflevector(below, below, 2, 3, 0, 1);
  return (below[0] & below[1]) != 0;
}

/// Lanes beyond kReducible, which are rare, are looked up one by one.
template <int W, class Isa>
[[gnu::always_inline]] inline void sincos(Pack<W, Isa> x, Pack<W, Isa>& s, Pack<W, Isa>& c) noexcept {
  using P = Pack<W, Isa>;
  using Bits = typename P::Bits;
  const P shifted = x * kTwoOverPi + kRounder;
  const Bits k = (Bits)shifted.v;
  P sine, cosine;
  sincos_kernel(reduced(x, shifted - kRounder), sine, cosine);
  const Bits a = (Bits)sine.v, b = (Bits)cosine.v, both = (a ^ b) & -(k & 1);
  s.v = (typename P::Lanes)((a ^ both) ^ ((k & 2) << 62));
  c.v = (typename P::Lanes)((b ^ both) ^ (((k + 1) & 2) << 62));
  if (all_below(abs(x), kReducible)) return;
  double lane[W], sl[W], cl[W];
  x.store(lane), s.store(sl), c.store(cl);
  for (int i = 0; i < W; ++i) {
    if (!(__builtin_fabs(lane[i]) < kReducible)) sl[i] = std::sin(lane[i]), cl[i] = std::cos(lane[i]);
  }
  s = P::load(sl), c = P::load(cl);
}

}  // namespace hamel::lie
