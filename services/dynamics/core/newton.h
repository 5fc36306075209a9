#pragma once
/// Newton's method for a chain: the exact Jacobian of an implicit step, factorised and applied in O(n).
///
/// A change x of the joint increments changes link i's twist and attitude, and what it carries, by
///   S_i = T_i S_{i-1} + b_i x_i                             S = (change of twist, turn of the frame)
///   Z_i = K_i S_i + T_{i+1}^T (Z_{i+1} - e_{i+1} x_{i+1})   Z = (change of momentum, of first moment)
///   change of residual_i = l_i . Z_i + k_i . S_i + c_i x_i
/// Joint by joint from the tip, Z_i = P_i S_i + z_i: the articulated-body idea with a matrix that is not
/// symmetric.  What b, e, l, k, K are is the tier's affair.
///
/// All in axes that do not turn from link to link, so that T moves the origin and nothing else: the plane's,
/// or the world's with gravity along the third.  There turns about gravity and moments along it do nothing
/// and are left out.

#include <array>
#include <vector>

#include "common/lie/pack.h"
#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

using rbd::SE2;
using rbd::SE3;

using Pair = lie::Pack<2, lie::Baseline>;

/// N numbers, two by two; the last one of an odd N beside zero.
template <int N>
struct Column {
  static constexpr std::size_t kSize = N, kPairs = (N + 1) / 2;
  std::array<Pair, kPairs> v{};
  [[gnu::always_inline]] double operator[](std::size_t i) const { return v[i / 2].v[i % 2]; }
  [[gnu::always_inline]] void add(std::size_t i, double x) { v[i / 2].v[i % 2] += x; }
};
/// x + s y.
template <int N>
[[gnu::always_inline]] inline Column<N> plus(Column<N> x, double s, const Column<N>& y) {
  for (std::size_t i = 0; i < x.kPairs; ++i) x.v[i] += s * y.v[i];
  return x;
}
/// x . y = its first number plus its second: two rows' are added at once.
template <int N>
[[gnu::always_inline]] inline Pair halves(const Column<N>& x, const Column<N>& y) {
  Pair sum = x.v[0] * y.v[0];
  for (std::size_t i = 1; i < x.kPairs; ++i) sum += x.v[i] * y.v[i];
  return sum;
}
template <int N>
[[gnu::always_inline]] inline double dot(const Column<N>& x, const Column<N>& y) {
  const Pair sum = halves(x, y);
  return sum.v[0] + sum.v[1];
}

/// The linearised equation of one joint.
template <int Changes, int Carries>
struct Linear {
  using Change = Column<Changes>;                           ///< S
  using Carried = Column<Carries>;                          ///< Z
  using Matrix = std::array<Change, std::size_t{Carries}>;  ///< P, row by row
  Change b, k;
  Carried e, l;
  double c = 0;
};
template <class G>
struct JointRow;
/// Twist (angular, linear) and turn about two axes; momentum (angular, linear) and moment along the two.
template <>
struct JointRow<SE3> : Linear<8, 8> {
  using Lever = lie::Vec3<double>;
};
/// In the plane: twist (angular, linear) and turn; momentum (angular, linear) and first moment.
template <>
struct JointRow<SE2> : Linear<4, 5> {
  using Lever = lie::Vec2<double>;
};

template <class G>
class ChainNewton {
 public:
  using Row = JointRow<G>;
  using Matrix = typename Row::Matrix;
  using Attitude = typename G::template Attitude<double>;
  using Frames = std::vector<typename G::template Frame<double>>;
  explicit ChainNewton(const typename G::Chain& chain);

  /// Asks row_of(i, attitude of link i, P), from the tip, for each joint's row; it also adds K_i to P.  Gives
  /// x with J x = r as well.  x may be r.
  template <class RowOf>
  void factorise_and_solve(const Frames& X, const RowOf& row_of, const double* r, double* x) noexcept {
    place(X);
    Matrix P{};
    typename Row::Carried z;
    for (int i = chain_.n(); i-- > 0;) {
      const Row row = row_of(i, R_[static_cast<std::size_t>(i)], P);
      eliminate(i, row, P);
      inward(i, r[i], z);
    }
    outward(x);
  }
  /// x with J x = r.  x may be r.
  void solve(const double* r, double* x) noexcept;

 private:
  struct JointFactor {
    typename Row::Change b, u;  ///< u, v: as the parent sees them
    typename Row::Carried l, v;
    typename Row::Lever p;  ///< from the parent's origin to this one
    double D_inv = 0;
  };
  void place(const Frames& X) noexcept;
  void eliminate(int i, const Row& row, Matrix& P) noexcept;
  void inward(int i, double r, typename Row::Carried& z) noexcept;
  void outward(double* x) noexcept;

  const typename G::Chain& chain_;
  std::vector<Attitude> R_;
  std::vector<JointFactor> factor_;
  std::vector<double> y_;
};

}  // namespace hamel::dynamics
