#pragma once
/// Coefficients of the s-point Gauss method on [0, 1].

#include <Eigen/Core>

namespace hamel::dynamics {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct GaussMethod {
  explicit GaussMethod(int stages);
  /// Integral of the j-th Lagrange polynomial from 0 to theta.
  double weight(Eigen::Index j, double theta) const noexcept;
  VectorXd c, b;
  MatrixXd a;            ///< a_ij = integral of the j-th Lagrange polynomial from 0 to c_i
  MatrixXd extrapolate;  ///< E_ij: j-th Lagrange polynomial at 1 + c_i
  MatrixXd power;        ///< column j: coefficients of 1, t, t^2, ... of the j-th Lagrange polynomial
};

}  // namespace hamel::dynamics
