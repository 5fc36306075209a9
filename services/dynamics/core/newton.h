#pragma once
/// Newton's method for a chain: the exact Jacobian of an implicit step, factorised and applied in O(n).
///
/// A change x of the joint increments changes link i's twist and attitude, and what it carries, by
///   S_i = T_i S_{i-1} + b_i x_i                       S = (change of twist V, turn phi of the frame)
///   Z_i = K_i S_i + T_{i+1}^T (Z_{i+1} - e_{i+1} x_{i+1})   Z = (change of momentum h, change of first
///   moment m) change of residual_i = l_i . Z_i + k_i . S_i + c_i x_i
/// with T = diag(X, R^T).  Joint by joint from the tip, Z_i = P_i S_i + z_i: the articulated-body idea with a
/// non-symmetric 9 x 9 instead of a symmetric 6 x 6.  What b, e, l, k, K are is the tier's affair.

#include <Eigen/Core>
#include <vector>

#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

using rbd::SE2;
using rbd::SE3;

/// Six coordinates of a twist or momentum, three of a turn or first moment.
struct Nine {
  rbd::Half6<double> h;
  lie::Vec3<double> m;
};
inline Nine operator+(const Nine& x, const Nine& y) { return {x.h + y.h, x.m + y.m}; }
inline Nine operator-(const Nine& x, const Nine& y) { return {x.h - y.h, x.m - y.m}; }
inline Nine operator*(double s, const Nine& x) { return {s * x.h, s * x.m}; }
inline double dot(const Nine& x, const Nine& y) {
  return dot(x.h.a, y.h.a) + dot(x.h.l, y.h.l) + dot(x.m, y.m);
}

/// 9 x 9 as blocks of 3: B[row][column].
struct Nine2 {
  lie::Mat3<double> B[3][3];
};

/// The linearised equation of one joint, and Z = P S beyond it.
template <class G>
struct JointRow;

template <>
struct JointRow<SE3> {
  using Change = Nine;   ///< S
  using Carried = Nine;  ///< Z
  using Matrix = Nine2;  ///< P
  Nine b, e, l, k;
  double c = 0;
  lie::Mat3<double> K[2][2];  ///< change of the link's own momentum with its twist
};

/// In the plane a turn is one number and a first moment two: S has four coordinates, Z five.
template <>
struct JointRow<SE2> {
  using Change = Eigen::Vector4d;               ///< twist (angular, linear), turn
  using Carried = Eigen::Matrix<double, 5, 1>;  ///< momentum (angular, linear), first moment
  using Matrix = Eigen::Matrix<double, 5, 4>;
  Change b = Change::Zero(), k = Change::Zero();
  Carried e = Carried::Zero(), l = Carried::Zero();
  double c = 0;
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
};

template <class G>
class ChainNewton {
 public:
  using Row = JointRow<G>;
  explicit ChainNewton(const typename G::Chain& chain);
  /// The caller fills rows(), then factorises at the frames X.
  std::vector<Row>& rows() noexcept { return rows_; }
  void factorise(const std::vector<typename G::template Frame<double>>& X) noexcept;
  /// x with J x = r.  x may be r.
  void solve(const double* r, double* x) noexcept;

 private:
  struct JointFactor {
    typename Row::Change u;
    typename Row::Carried v;
    double D_inv = 0;
  };
  const typename G::Chain& chain_;
  std::vector<Row> rows_;
  std::vector<JointFactor> factor_;
  std::vector<typename G::template Frame<double>> X_;
  std::vector<double> y_;
};

}  // namespace hamel::dynamics
