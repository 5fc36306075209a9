#include "services/dynamics/core/newton.h"

namespace hamel::dynamics {
namespace {

using lie::Vec2;
using lie::Vec3;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

template <std::size_t N>
double dot(const std::array<double, N>& x, const std::array<double, N>& y) {
  double sum = 0;
  for (std::size_t i = 0; i < N; ++i) sum += x[i] * y[i];
  return sum;
}
/// x + s y.
template <std::size_t N>
std::array<double, N> plus(std::array<double, N> x, double s, const std::array<double, N>& y) {
  for (std::size_t i = 0; i < N; ++i) x[i] += s * y[i];
  return x;
}

/// The origin moves by p: twists to the child, momenta to the parent.
void to_child(const Vec3<double>& p, Column<8>& S) {
  S[3] += S[1] * p.z - S[2] * p.y;
  S[4] += S[2] * p.x - S[0] * p.z;
  S[5] += S[0] * p.y - S[1] * p.x;
}
void to_parent(const Vec3<double>& p, Column<8>& Z) {
  Z[0] += p.y * Z[5] - p.z * Z[4];
  Z[1] += p.z * Z[3] - p.x * Z[5];
  Z[2] += p.x * Z[4] - p.y * Z[3];
}
void to_child(const Vec2<double>& p, Column<4>& S) {
  S[1] -= S[0] * p.y;
  S[2] += S[0] * p.x;
}
void to_parent(const Vec2<double>& p, Column<5>& Z) { Z[0] += p.x * Z[2] - p.y * Z[1]; }

/// T^T P T: angular columns gain, then angular rows.
void to_parent(const Vec3<double>& p, JointRow<SE3>::Matrix& P) {
  for (Column<8>& row : P) {
    row[0] += p.y * row[5] - p.z * row[4];
    row[1] += p.z * row[3] - p.x * row[5];
    row[2] += p.x * row[4] - p.y * row[3];
  }
  for (std::size_t c = 0; c < 8; ++c) {
    P[0][c] += p.y * P[5][c] - p.z * P[4][c];
    P[1][c] += p.z * P[3][c] - p.x * P[5][c];
    P[2][c] += p.x * P[4][c] - p.y * P[3][c];
  }
}
void to_parent(const Vec2<double>& p, JointRow<SE2>::Matrix& P) {
  for (Column<4>& row : P) row[0] += p.x * row[2] - p.y * row[1];
  for (std::size_t c = 0; c < 4; ++c) P[0][c] += p.x * P[2][c] - p.y * P[1][c];
}

/// The attitude that all links' are reckoned from: gravity along the third axis.
lie::Mat3<double> level(const Vec3<double>& gravity) {
  const Eigen::Vector3d g(gravity.x, gravity.y, gravity.z);
  const double size = g.norm();
  if (!(size > 0)) return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  return lie::mat3(rbd::frame_about(g / size).transpose());
}
rbd::NoAttitude level(const Vec2<double>&) { return {}; }
Vec3<double> turned(const lie::Mat3<double>& R, const Vec3<double>& p) { return R * p; }
Vec2<double> turned(rbd::NoAttitude, const Vec2<double>& p) { return p; }

}  // namespace

template <class G>
ChainNewton<G>::ChainNewton(const typename G::Chain& chain)
    : chain_(chain), R_(at(chain.n())), factor_(at(chain.n())), y_(at(chain.n())) {}

template <class G>
void ChainNewton<G>::place(const Frames& X) noexcept {
  Attitude R = level(chain_.gravity_W);
  for (int i = 0; i < chain_.n(); ++i) {
    factor_[at(i)].p = turned(R, X[at(i)].p);
    R_[at(i)] = R = attitude(X[at(i)], &R);
  }
}

template <class G>
void ChainNewton<G>::eliminate(int i, const Row& row, Matrix& P) noexcept {
  JointFactor& f = factor_[at(i)];
  f.b = row.b, f.l = row.l;
  typename Row::Change u = row.k;  // P^T l + k
  typename Row::Carried v;         // P b - e
  for (std::size_t r = 0; r < P.size(); ++r) {
    u = plus(u, row.l[r], P[r]);
    v[r] = dot(P[r], row.b) - row.e[r];
  }
  f.D_inv = 1 / (dot(u, row.b) + row.c);
  f.u = u, f.v = v;
  if (i == 0) return;
  for (std::size_t r = 0; r < P.size(); ++r) P[r] = plus(P[r], -f.D_inv * v[r], u);
  to_parent(f.p, P);
}

template <class G>
void ChainNewton<G>::solve(const double* r, double* x) noexcept {
  typename Row::Carried z{};
  for (int i = chain_.n(); i-- > 0;) {
    const JointFactor& f = factor_[at(i)];
    y_[at(i)] = (r[i] - dot(f.l, z)) * f.D_inv;
    if (i == 0) break;
    z = plus(z, y_[at(i)], f.v);
    to_parent(f.p, z);
  }
  typename Row::Change S{};
  for (int i = 0; i < chain_.n(); ++i) {
    const JointFactor& f = factor_[at(i)];
    if (i > 0) to_child(f.p, S);
    x[i] = y_[at(i)] - f.D_inv * dot(f.u, S);
    S = plus(S, x[i], f.b);
  }
}

template class ChainNewton<SE3>;
template class ChainNewton<SE2>;

}  // namespace hamel::dynamics
