#pragma once
/// Points that fill a box evenly, however many are taken.

#include <cmath>
#include <vector>

namespace hamel {

/// Point k >= 0 of the additive sequence R_d in [0, 1)^dimensions: u_i = frac(1/2 + k/phi^(i+1)), where phi
/// is the positive root of x^(d+1) = x + 1. [Roberts 2018]
inline std::vector<double> even_point(int dimensions, int k) {
  double phi = 2, step = 1;
  for (int it = 0; it < 30; ++it) phi = std::pow(1 + phi, 1.0 / (dimensions + 1));
  std::vector<double> u(static_cast<std::size_t>(dimensions));
  for (double& x : u) {
    step /= phi;
    x = 0.5 + step * k;
    x -= std::floor(x);
  }
  return u;
}

}  // namespace hamel
