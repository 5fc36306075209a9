#pragma once
/// Sine and cosine together, for any scalar of the recursions: a number, or numbers side by side.
///
/// Cody and Waite's reduction by pi/2 in three parts, then the kernels of [fdlibm]: at most 2.5 ulp for
/// |x| < 1.6e6, which tests/property/lie_test.cpp measures; the C library's beyond.  Sums and products only,
/// in one order: every lane of a pack gets the bits that a number alone would get.

#include <bit>
#include <cmath>
#include <cstdint>

namespace hamel::lie {

/// Angles up to this are reduced here [rad].
inline constexpr double kReducible = 1.6e6;

/// sin r and cos r for |r| <= pi/4.  Polynomials by pairs of terms: half as deep as term by term.
template <class S>
[[gnu::always_inline]] inline void sincos_kernel(const S& r, S& s, S& c) noexcept {
  const S z = r * r, zz = z * z;
  const S sine = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                 zz * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                       zz * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10));
  const S cosine = (4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                   zz * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                         zz * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
  s = r + r * z * sine;
  const S half = 0.5 * z, w = 1.0 - half;
  c = w + ((1.0 - w - half) + zz * cosine);
}
/// x - k pi/2 for an integer k below 2^20: the first two products are exact.
template <class S>
[[gnu::always_inline]] inline S reduced(const S& x, const S& k) noexcept {
  return x - k * 1.57079632673412561417e+00 - k * 6.07710050630396597660e-11 - k * 2.02226624879595063154e-21;
}
/// Adding and taking away rounds to the nearest integer, and its last bits are the integer's.
inline constexpr double kRounder = 0x1.8p52;
inline constexpr double kTwoOverPi = 6.36619772367581382433e-01;

[[gnu::always_inline]] inline void sincos(double x, double& s, double& c) noexcept {
  if (!(std::abs(x) < kReducible)) {
    s = std::sin(x), c = std::cos(x);
    return;
  }
  const double shifted = x * kTwoOverPi + kRounder;
  const std::uint64_t k = std::bit_cast<std::uint64_t>(shifted);
  double sine, cosine;
  sincos_kernel(reduced(x, shifted - kRounder), sine, cosine);
  // quarter turns: odd ones swap the two, the second bit turns the sign
  const std::uint64_t swap = 0 - (k & 1), a = std::bit_cast<std::uint64_t>(sine),
                      b = std::bit_cast<std::uint64_t>(cosine), both = (a ^ b) & swap;
  s = std::bit_cast<double>((a ^ both) ^ ((k & 2) << 62));
  c = std::bit_cast<double>((b ^ both) ^ (((k + 1) & 2) << 62));
}

}  // namespace hamel::lie
