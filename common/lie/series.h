#pragma once
/// The removable singularities of rotation formulas, all in one home.
///
/// Each function takes x = theta^2 >= 0 and is analytic at 0.  Below kSwitch a power series is summed, above
/// it the closed form in half angles.  The group functions made of them are right to 8 eps times the
/// condition number at every angle up to 1e6 rad (tests/property/lie_accuracy_test.cpp); |theta| must stay
/// below 1e154.

#include <array>
#include <cmath>
#include <cstddef>

namespace hamel::lie {

/// theta^2 below which the nine-term series replaces the closed form.
inline constexpr double kSwitch = 0.5;
/// The same for coefficients of higher order, whose closed forms cancel more; eighteen terms.
inline constexpr double kWideSwitch = 9.0;

/// The same for cotc, whose closed form cancels up to theta = 2; twenty-four terms.
inline constexpr double kCotSwitch = 4.0;

template <std::size_t N>
constexpr double horner(const std::array<double, N>& c, double x) noexcept {
  double r = c[N - 1];
  for (std::size_t i = N - 1; i-- > 0;) r = r * x + c[i];
  return r;
}

/// 1/first!, -1/(first+2)!, 1/(first+4)!, ...
template <std::size_t N>
constexpr std::array<double, N> alternating_inverse_factorials(int first) noexcept {
  std::array<double, N> c{};
  double f = 1;
  for (int k = 2; k <= first; ++k) f *= k;
  for (std::size_t i = 0; i < N; ++i, first += 2) {
    c[i] = (i % 2 == 0 ? 1.0 : -1.0) / f;
    f *= static_cast<double>(first + 1) * (first + 2);
  }
  return c;
}

/// sin(theta) / theta.
inline double sinc(double x) noexcept {
  static constexpr auto c = alternating_inverse_factorials<9>(1);
  if (x < kSwitch) return horner(c, x);
  const double t = std::sqrt(x);
  return std::sin(t) / t;
}

/// (1 - cos theta) / theta^2, in the half angle: no cancellation.
inline double cosc(double x) noexcept {
  static constexpr auto c = alternating_inverse_factorials<9>(2);
  if (x < kSwitch) return horner(c, x);
  const double h = 0.5 * std::sqrt(x), s = std::sin(h) / h;
  return 0.5 * s * s;
}

/// (theta - sin theta) / theta^3.
inline double sinc3(double x) noexcept {
  static constexpr auto c = alternating_inverse_factorials<9>(3);
  if (x < kSwitch) return horner(c, x);
  const double t = std::sqrt(x);
  return (t - std::sin(t)) / (x * t);
}

/// (theta^2 / 2 + cos theta - 1) / theta^4.
inline double cosc4(double x) noexcept {
  static constexpr auto c = alternating_inverse_factorials<18>(4);
  if (x < kWideSwitch) return horner(c, x);
  const double s = std::sin(0.5 * std::sqrt(x));
  return (0.5 * x - 2 * s * s) / (x * x);
}

/// (2 + cos theta - 3 sin(theta) / theta) / theta^4.
inline double cosc6(double x) noexcept {
  static constexpr auto c = [] {
    auto a = alternating_inverse_factorials<18>(5);  // (2 k + 2) / (2 k + 5)!, signs in turn
    for (std::size_t k = 0; k < a.size(); ++k) a[k] *= static_cast<double>(2 * k + 2);
    return a;
  }();
  if (x < kWideSwitch) return horner(c, x);
  const double t = std::sqrt(x);
  return (2 + std::cos(t) - 3 * std::sin(t) / t) / (x * x);
}

/// |B_2k| / (2k)! = 2 zeta(2k) / (2 pi)^2k for k = 1, 2, ...: the coefficients of cotc.
constexpr std::array<double, 24> cotc_coefficients() noexcept {
  std::array<double, 24> c{1. / 12,
                           1. / 720,
                           1. / 30240,
                           1. / 1209600,
                           1. / 47900160,
                           691. / 1307674368000.,
                           1. / 74724249600.,
                           3617. / 10670622842880000.,
                           43867. / 5109094217170944000.};
  constexpr double four_pi_squared = 39.478417604357434475;
  double power = 1;  // (2 pi)^2k
  for (std::size_t i = 0; i < c.size(); ++i) {
    power *= four_pi_squared;
    if (i < 9) continue;
    double zeta = 1;
    for (int m = 2; m < 8; ++m) {
      double inverse = 1;
      for (std::size_t k = 0; k <= i; ++k) inverse /= m * m;
      zeta += inverse;
    }
    c[i] = 2 * zeta / power;
  }
  return c;
}

/// Share of theta/2 below which its sine counts as zero: 2 pi k is no double, what rounding hides is the
/// pole.
inline constexpr double kPole = 1e-15;

/// (1 - (theta/2) cot(theta/2)) / theta^2.  Infinite at its poles theta = 2 pi k, k >= 1.
inline double cotc(double x) noexcept {
  static constexpr auto c = cotc_coefficients();
  if (x < kCotSwitch) return horner(c, x);
  const double h = 0.5 * std::sqrt(x), s = std::sin(h);
  return std::abs(s) <= kPole * h ? HUGE_VAL : (1 - h * std::cos(h) / s) / x;
}

/// How near the inverse of dexp is to a pole: its condition |theta/2 / sin(theta/2)|, 1 at theta = 0,
/// infinite at a pole theta = 2 pi k, k >= 1.  Digits lost there are log10 of it.
inline double pole_condition(double x) noexcept {
  if (x < kSwitch) return 1 / sinc(0.25 * x);
  const double h = 0.5 * std::sqrt(x), s = std::sin(h);
  return std::abs(s) <= kPole * h ? HUGE_VAL : std::abs(h / s);
}

}  // namespace hamel::lie
