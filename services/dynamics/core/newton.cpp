#include "services/dynamics/core/newton.h"

#include <algorithm>

namespace hamel::dynamics {
namespace {

using lie::Mat3;
using lie::Vec3;
using Pose = rbd::LinkPose<double>;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Nine to_child(const Pose& X, const Nine& S) { return {to_child(X, S.h), transpose_times(X.R, S.m)}; }
Nine to_parent(const Pose& X, const Nine& Z) { return {to_parent(X, Z.h), X.R * Z.m}; }

/// B hat(p).
Mat3<double> times_hat(const Mat3<double>& B, const Vec3<double>& p) {
  return {p.z * B.y - p.y * B.z, p.x * B.z - p.z * B.x, p.y * B.x - p.x * B.y};
}
Mat3<double> operator-(const Mat3<double>& A, const Mat3<double>& B) {
  return {A.x - B.x, A.y - B.y, A.z - B.z};
}

/// T^T P T: every block turned, then the lever of p on angular columns and rows.
Nine2 to_parent(const Pose& X, const Nine2& P) {
  Nine2 Q;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) Q.B[r][c] = rotate(X.R, P.B[r][c]);
    Q.B[r][0] = Q.B[r][0] - times_hat(Q.B[r][1], X.p);
  }
  for (int c = 0; c < 3; ++c) Q.B[0][c] += cross(X.p, Q.B[1][c]);
  return Q;
}

Nine times(const Nine2& P, const Nine& x) {
  const auto row = [&](int r) { return P.B[r][0] * x.h.a + P.B[r][1] * x.h.l + P.B[r][2] * x.m; };
  return {{row(0), row(1)}, row(2)};
}
Nine transpose_times(const Nine2& P, const Nine& x) {
  const auto column = [&](int c) {
    return lie::transpose_times(P.B[0][c], x.h.a) + lie::transpose_times(P.B[1][c], x.h.l) +
           lie::transpose_times(P.B[2][c], x.m);
  };
  return {{column(0), column(1)}, column(2)};
}

/// P - s v u^T.
void subtract_outer(Nine2& P, double s, const Nine& v, const Nine& u) {
  const Vec3<double>* left[] = {&v.h.a, &v.h.l, &v.m};
  const Vec3<double>* right[] = {&u.h.a, &u.h.l, &u.m};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) P.B[r][c] = lie::minus_outer(P.B[r][c], s, *left[r], *right[c]);
  }
}

/// Adds the link's own inertia to what it carries.
void add(Nine2& P, const JointRow<SE3>& row) {
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 2; ++c) P.B[r][c] += row.K[r][c];
  }
}

// ---- the same in the plane, where a frame differs from its parent's by a translation

using Change = JointRow<SE2>::Change;
using Carried = JointRow<SE2>::Carried;
using Planar = JointRow<SE2>::Matrix;
using PlanarPose = rbd::PlanarFrame<double>;

Change to_child(const PlanarPose& X, const Change& S) {
  return {S[0], S[1] - S[0] * X.p.y, S[2] + S[0] * X.p.x, S[3]};
}
Carried to_parent(const PlanarPose& X, Carried Z) {
  Z[0] += X.p.x * Z[2] - X.p.y * Z[1];
  return Z;
}
Planar to_parent(const PlanarPose& X, Planar P) {
  P.col(0) += X.p.x * P.col(2) - X.p.y * P.col(1);
  P.row(0) += X.p.x * P.row(2) - X.p.y * P.row(1);
  return P;
}
Carried times(const Planar& P, const Change& x) { return P * x; }
Change transpose_times(const Planar& P, const Carried& x) { return P.transpose() * x; }
void subtract_outer(Planar& P, double s, const Carried& v, const Change& u) {
  P.noalias() -= s * v * u.transpose();
}
void add(Planar& P, const JointRow<SE2>& row) { P.topLeftCorner<3, 3>() += row.K; }
template <int N>
double dot(const Eigen::Matrix<double, N, 1>& x, const Eigen::Matrix<double, N, 1>& y) {
  return x.dot(y);
}
void clear(Planar& P) { P.setZero(); }
void clear(Nine2& P) { P = {}; }
template <int N>
void clear(Eigen::Matrix<double, N, 1>& x) {
  x.setZero();
}
void clear(Nine& x) { x = {}; }

}  // namespace

template <class G>
ChainNewton<G>::ChainNewton(const typename G::Chain& chain)
    : chain_(chain), rows_(at(chain.n())), factor_(at(chain.n())), X_(at(chain.n())), y_(at(chain.n())) {}

template <class G>
void ChainNewton<G>::factorise(const std::vector<typename G::template Frame<double>>& X) noexcept {
  std::copy(X.begin(), X.end(), X_.begin());
  typename Row::Matrix P;
  clear(P);
  for (int i = chain_.n(); i-- > 0;) {
    const Row& row = rows_[at(i)];
    add(P, row);
    JointFactor& f = factor_[at(i)];
    f.u = transpose_times(P, row.l) + row.k;
    f.v = times(P, row.b) - row.e;
    f.D_inv = 1 / (dot(f.u, row.b) + row.c);
    if (i == 0) break;
    subtract_outer(P, f.D_inv, f.v, f.u);
    P = to_parent(X[at(i)], P);
  }
}

template <class G>
void ChainNewton<G>::solve(const double* r, double* x) noexcept {
  typename Row::Carried z;
  clear(z);
  for (int i = chain_.n(); i-- > 0;) {
    const JointFactor& f = factor_[at(i)];
    y_[at(i)] = (r[i] - dot(rows_[at(i)].l, z)) * f.D_inv;
    if (i > 0) z = to_parent(X_[at(i)], typename Row::Carried(z + y_[at(i)] * f.v));
  }
  typename Row::Change S;
  clear(S);
  for (int i = 0; i < chain_.n(); ++i) {
    const JointFactor& f = factor_[at(i)];
    if (i > 0) S = to_child(X_[at(i)], S);
    x[i] = y_[at(i)] - f.D_inv * dot(f.u, S);
    S = S + x[i] * rows_[at(i)].b;
  }
}

template class ChainNewton<SE3>;
template class ChainNewton<SE2>;

}  // namespace hamel::dynamics
