#pragma once
/// A number that counts what is done to it, for the recursions that take any scalar.  Include it before them.

#include <cmath>

#include "common/lie/sincos.h"

namespace hamel::test {

/// Stands for a pack of one lane.
struct Counted {
  static constexpr int kWidth = 1;
  inline static long operations = 0;
  double v = 0;

  static Counted count(double x) { return ++operations, Counted{x}; }
  static Counted of(double x) { return {x}; }
  static Counted load(const double* p) { return {*p}; }
  void store(double* p) const { *p = v; }

  friend Counted operator+(Counted a, Counted b) { return count(a.v + b.v); }
  friend Counted operator-(Counted a, Counted b) { return count(a.v - b.v); }
  friend Counted operator*(Counted a, Counted b) { return count(a.v * b.v); }
  friend Counted operator/(Counted a, Counted b) { return count(a.v / b.v); }
  friend Counted operator+(Counted a, double b) { return count(a.v + b); }
  friend Counted operator-(Counted a, double b) { return count(a.v - b); }
  friend Counted operator*(Counted a, double b) { return count(a.v * b); }
  friend Counted operator+(double a, Counted b) { return count(a + b.v); }
  friend Counted operator-(double a, Counted b) { return count(a - b.v); }
  friend Counted operator*(double a, Counted b) { return count(a * b.v); }
  friend Counted operator/(double a, Counted b) { return count(a / b.v); }
  Counted operator-() const { return count(-v); }
  Counted& operator+=(Counted b) { return *this = *this + b; }
  Counted& operator-=(Counted b) { return *this = *this - b; }
  Counted& operator+=(double b) { return *this = *this + b; }
  Counted& operator-=(double b) { return *this = *this - b; }
  friend Counted abs(Counted a) { return count(std::abs(a.v)); }
  friend Counted larger(Counted a, Counted b) { return count(a.v > b.v ? a.v : b.v); }
};

}  // namespace hamel::test

namespace hamel::lie {

inline void sincos(test::Counted x, test::Counted& s, test::Counted& c) {
  ++test::Counted::operations;
  sincos(x.v, s.v, c.v);
}

}  // namespace hamel::lie
