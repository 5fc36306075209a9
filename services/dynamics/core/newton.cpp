#include "services/dynamics/core/newton.h"

#include "services/dynamics/core/node.h"

namespace hamel::dynamics {
namespace {

using lie::Vec2;
using lie::Vec3;

/// The origin moves by p: twists to the child, momenta to the parent.
void to_child(const Vec3<double>& p, Column<8>& S) {
  const Vec3<double> moved = cross(Vec3<double>{S[0], S[1], S[2]}, p);
  S.add(3, moved.x), S.add(4, moved.y), S.add(5, moved.z);
}
void to_parent(const Vec3<double>& p, Column<8>& Z) {
  const Vec3<double> moved = cross(p, Vec3<double>{Z[3], Z[4], Z[5]});
  Z.add(0, moved.x), Z.add(1, moved.y), Z.add(2, moved.z);
}
void to_child(const Vec2<double>& p, Column<4>& S) {
  const Vec2<double> moved = turned(S[0], p);
  S.add(1, moved.x), S.add(2, moved.y);
}
template <int N>
void to_parent(const Vec2<double>& p, Column<N>& Z) {
  Z.add(0, cross(p, Vec2<double>{Z[1], Z[2]}));
}

/// T^T P T: angular columns gain, then angular rows.
void to_parent(const Vec3<double>& p, JointRow<SE3>::Matrix& P) {
  for (Column<8>& row : P) to_parent(p, row);
  P[0] = plus(plus(P[0], p.y, P[5]), -p.z, P[4]);
  P[1] = plus(plus(P[1], p.z, P[3]), -p.x, P[5]);
  P[2] = plus(plus(P[2], p.x, P[4]), -p.y, P[3]);
}
void to_parent(const Vec2<double>& p, JointRow<SE2>::Matrix& P) {
  for (Column<4>& row : P) to_parent(p, row);
  P[0] = plus(plus(P[0], p.x, P[2]), -p.y, P[1]);
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
  typename Row::Change u = row.k;   // P^T l + k
  typename Row::Carried v = row.e;  // P b - e
  for (std::size_t r = 0; r < P.size(); ++r) u = plus(u, row.l[r], P[r]);
  for (std::size_t j = 0; j < v.kPairs; ++j) {
    const Pair x = halves(P[2 * j], row.b), y = 2 * j + 1 < P.size() ? halves(P[2 * j + 1], row.b) : Pair{};
    v.v[j] = Pair{{x.v[0], y.v[0]}} + Pair{{x.v[1], y.v[1]}} - v.v[j];
  }
  f.b = row.b, f.l = row.l;
  f.D_inv = 1 / (dot(u, row.b) + row.c);
  if (i == 0) return;
  to_parent(f.p, P), to_parent(f.p, u), to_parent(f.p, v);
  f.u = u, f.v = v;
  for (std::size_t r = 0; r < P.size(); ++r) P[r] = plus(P[r], -f.D_inv * v[r], u);
}

template <class G>
void ChainNewton<G>::inward(int i, double r, typename Row::Carried& z) noexcept {
  const JointFactor& f = factor_[at(i)];
  const double y = y_[at(i)] = (r - dot(f.l, z)) * f.D_inv;
  if (i == 0) return;
  to_parent(f.p, z);
  z = plus(z, y, f.v);
}

template <class G>
void ChainNewton<G>::outward(double* x) noexcept {
  typename Row::Change S;
  for (int i = 0; i < chain_.n(); ++i) {
    const JointFactor& f = factor_[at(i)];
    x[i] = i > 0 ? y_[at(i)] - f.D_inv * dot(f.u, S) : y_[at(i)];
    if (i > 0) to_child(f.p, S);
    S = plus(S, x[i], f.b);
  }
}

template <class G>
void ChainNewton<G>::solve(const double* r, double* x) noexcept {
  typename Row::Carried z;
  for (int i = chain_.n(); i-- > 0;) inward(i, r[i], z);
  outward(x);
}

template class ChainNewton<SE3>;
template class ChainNewton<SE2>;

}  // namespace hamel::dynamics
