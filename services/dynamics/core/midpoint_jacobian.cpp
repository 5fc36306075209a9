// The exact Jacobian of the midpoint step, joint by joint.
#include "services/dynamics/core/midpoint.h"

namespace hamel::dynamics {
namespace {

using lie::Mat3;
using lie::Vec2;
using lie::Vec3;
using Motion = rbd::Half6<double>;

/// Twist and turn, or momentum and moment, of a link in the axes that do not turn.
[[gnu::always_inline]] inline Column<8> level(const Mat3<double>& R, const Motion& h, const Vec3<double>& m) {
  const Vec3<double> a = R * h.a, l = R * h.l;
  return {a.x,
          a.y,
          a.z,
          l.x,
          l.y,
          l.z,
          R.x.x * m.x + R.y.x * m.y + R.z.x * m.z,
          R.x.y * m.x + R.y.y * m.y + R.z.y * m.z};
}

/// Adds the inertia of a link.
[[gnu::always_inline]] inline void add_inertia(const lie::Sym3<double>& I, const Vec3<double>& h, double mass,
                                               JointRow<SE3>::Matrix& P) {
  const double rows[6][6] = {{I.xx, I.xy, I.xz, 0, -h.z, h.y}, {I.xy, I.yy, I.yz, h.z, 0, -h.x},
                             {I.xz, I.yz, I.zz, -h.y, h.x, 0}, {0, h.z, -h.y, mass, 0, 0},
                             {-h.z, 0, h.x, 0, mass, 0},       {h.y, -h.x, 0, 0, 0, mass}};
  for (std::size_t r = 0; r < 6; ++r)
    for (std::size_t c = 0; c < 6; ++c) P[r][c] += rows[r][c];
}

}  // namespace

/// What damping, armature and stops add on the diagonal.
template <class G>
double MidpointStep<G>::diagonal(int i, double d) const noexcept {
  const auto& k = chain_[i];
  return k.armature * rate_ + 0.5 * k.damping +
         0.25 * h_ * stop_slope(k, options_.stop_stiffness, from_->q[i] + 0.5 * d);
}

/// One joint of the exact Jacobian.  With B = A/h + ad_V A / 2:
///   change of V:  X (V of the parent) + B x
///   turn:         R^T (turn of the parent) + (angular part of A) x / 2
///   change of h:  I (change of V) + X^T (change of h - ad_A^T h x / 2), and so for the first moment m
///   change of r:  A^T (change of h - (h/2)(ad_{change of V}^T h + ad_V^T (change of h) + change of w))
/// where w = (m x g, mass g) and a turn phi changes g by g x phi.
/// The torques of outer wrenches are left out: their change with d is of the next order in h.
template <>
JointRow<SE3> MidpointStep<SE3>::row(int i, double d, const Mat3<double>& R, Matrix& P) const noexcept {
  const auto& k = chain_[i];
  const Motion &V = V_[at(i)], &H = H_[at(i)];
  const Vec3<double>&g = g_[at(i)], &m = moment_[at(i)];
  const double half = 0.5 * h_;
  const Motion turn = rbd::bracket_with_axis(k, X_[at(i)], V, 1.0);  // ad_V A
  const Motion A = joint_axis(k, X_[at(i)]), coad = coadjoint(A, H);
  JointRow<SE3> j;
  j.b = level(R, rate_ * A + 0.5 * turn, 0.5 * A.a);
  j.e = level(R, 0.5 * coad,
              k.prismatic ? Vec3<double>{0, 0, -0.5 * k.outer_mass} : Vec3<double>{0.5 * m.y, -0.5 * m.x, 0});
  j.l = level(R, A - half * turn, -half * cross(g, A.a));
  j.k = level(R, half * coad,
              k.prismatic ? -half * k.outer_mass * cross(A.l, g) : -half * (g.z * m - dot(m, g) * A.a));
  j.c = diagonal(i, d);
  add_inertia(rotate(R, k.I_o), R * k.h, k.mass, P);
  return j;
}

/// The same in the plane's axes, where e_3 x turns by a quarter.
template <>
JointRow<SE2> MidpointStep<SE2>::row(int i, double d, const rbd::NoAttitude&, Matrix& P) const noexcept {
  const rbd::PlanarLink& k = chain_[i];
  const rbd::PlanarFrame<double>& X = X_[at(i)];
  const rbd::Half3<double>&V = V_[at(i)], &H = H_[at(i)];
  const Vec2<double>&g = g_[at(i)], &m = moment_[at(i)];
  const double half = 0.5 * h_;
  const rbd::Half3<double> A = joint_axis(k, X), turn = bracket_with_axis(k, X, V, 1.0),
                           coad = coadjoint(A, H);
  const rbd::Half3<double> twist = rate_ * A + 0.5 * turn, row = A - half * turn;
  const Vec2<double> e_m = k.prismatic ? (-0.5 * k.outer_mass) * A.l : turned(-0.5 * k.sign, m);
  const Vec2<double> l_m = turned(half * A.a, g);
  JointRow<SE2> j;
  j.b = {twist.a, twist.l.x, twist.l.y, 0.5 * A.a};
  j.e = {0.5 * coad.a, 0.5 * coad.l.x, 0.5 * coad.l.y, e_m.x, e_m.y};
  j.l = {row.a, row.l.x, row.l.y, l_m.x, l_m.y};
  j.k = {half * coad.a, half * coad.l.x, half * coad.l.y,
         k.prismatic ? -half * k.outer_mass * cross(A.l, g) : half * k.sign * dot(m, g)};
  j.c = diagonal(i, d);
  P[0][0] += k.I_o, P[0][1] -= X.h.y, P[0][2] += X.h.x;
  P[1][0] -= X.h.y, P[1][1] += k.mass;
  P[2][0] += X.h.x, P[2][2] += k.mass;
  return j;
}

template <class G>
void MidpointStep<G>::linearise(const VectorXd& d) noexcept {
  newton_.factorise(X_, [&](int i, const auto& R, Matrix& P) { return row(i, d[i], R, P); });
}

template void MidpointStep<SE3>::linearise(const VectorXd&) noexcept;
template void MidpointStep<SE2>::linearise(const VectorXd&) noexcept;

}  // namespace hamel::dynamics
