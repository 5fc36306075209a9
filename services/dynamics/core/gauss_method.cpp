#include "services/dynamics/core/gauss_method.h"

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "services/dynamics/core/node.h"

namespace hamel::dynamics {
namespace {

using Real = long double;

/// Legendre polynomial P_s and its slope at x in (-1, 1).
std::pair<Real, Real> legendre(int s, Real x) {
  Real before = 1, p = x;
  for (int k = 2; k <= s; ++k) {
    const Real next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
    before = p, p = next;
  }
  return {p, s * (x * p - before) / (x * x - 1)};
}

/// The j-th Lagrange polynomial over `nodes` at t.
Real lagrange(const std::vector<Real>& nodes, std::size_t j, Real t) {
  Real product = 1;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    if (k != j) product *= (t - nodes[k]) / (nodes[j] - nodes[k]);
  }
  return product;
}

}  // namespace

GaussMethod::GaussMethod(int stages)
    : c(stages), b(stages), a(stages, stages), extrapolate(stages, stages), power(stages, stages) {
  std::vector<Real> nodes, weights;
  for (int i = 0; i < stages; ++i) {
    Real x = -std::cos(std::numbers::pi_v<Real> * (i + 0.75L) / (stages + 0.5L));
    for (int k = 0; k < 50; ++k) x -= legendre(stages, x).first / legendre(stages, x).second;
    const Real slope = legendre(stages, x).second;
    nodes.push_back((1 + x) / 2);
    weights.push_back(1 / ((1 - x * x) * slope * slope));
  }
  for (int i = 0; i < stages; ++i) {
    c[i] = static_cast<double>(nodes[at(i)]);
    b[i] = static_cast<double>(weights[at(i)]);
    for (int j = 0; j < stages; ++j) {
      // the polynomial has degree s - 1: the method's own quadrature over [0, c_i] is exact
      Real integral = 0;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        integral += nodes[at(i)] * weights[k] * lagrange(nodes, at(j), nodes[at(i)] * nodes[k]);
      }
      a(i, j) = static_cast<double>(integral);
      extrapolate(i, j) = static_cast<double>(lagrange(nodes, at(j), 1 + nodes[at(i)]));
    }
  }
  // coefficients of the Lagrange polynomials, for integrals to any time
  for (int j = 0; j < stages; ++j) {
    std::vector<Real> poly{1};
    for (int k = 0; k < stages; ++k) {
      if (k == j) continue;
      const Real scale = 1 / (nodes[at(j)] - nodes[at(k)]);
      std::vector<Real> longer(poly.size() + 1, 0);
      for (std::size_t d = 0; d < poly.size(); ++d) {
        longer[d] -= poly[d] * nodes[at(k)] * scale;
        longer[d + 1] += poly[d] * scale;
      }
      poly = longer;
    }
    for (int d = 0; d < stages; ++d) power(d, j) = static_cast<double>(poly[at(d)]);
  }
}

double GaussMethod::weight(Eigen::Index j, double theta) const noexcept {
  double sum = 0;
  for (Eigen::Index d = power.rows(); d-- > 0;) sum = sum * theta + power(d, j) / static_cast<double>(d + 1);
  return sum * theta;
}

}  // namespace hamel::dynamics
