// The exact Jacobian of the midpoint step, joint by joint.
#include "services/dynamics/core/midpoint.h"

namespace hamel::dynamics {
namespace {
std::size_t at(int i) { return static_cast<std::size_t>(i); }
}  // namespace

/// What damping, armature and stops add on the diagonal.
template <class G>
double MidpointStep<G>::diagonal(int i, double d) const noexcept {
  const auto& k = chain_[i];
  return k.armature / h_ + 0.5 * k.damping +
         0.25 * h_ * stop_slope(k, options_.stop_stiffness, from_->q[i] + 0.5 * d);
}

/// One joint of the exact Jacobian.  With B = A/h + ad_V A / 2:
///   change of V:      X (V of the parent) + B x          turn: R^T (turn of the parent) + (angular part of
///   A) x / 2 change of h:      I (change of V) + X^T (change of h - ad_A^T h x / 2), and so for the first
///   moment m change of r:      A^T (change of h - (h/2)(ad_{change of V}^T h + ad_V^T (change of h) + change
///   of w))
/// where w = (m x g, mass g) and a turn phi changes g by g x phi.
/// The torques of outer wrenches are left out: their change with d is of the next order in h.
template <>
JointRow<SE3> MidpointStep<SE3>::row(int i, double d) const noexcept {
  using lie::Vec3;
  const auto& k = chain_[i];
  const rbd::Half6<double>&V = V_[at(i)], &H = H_[at(i)];
  const Vec3<double>&g = g_[at(i)], &m = moment_[at(i)];
  const double half = 0.5 * h_;
  const rbd::Half6<double> turn = rbd::bracket_with_axis(k, X_[at(i)], V, 1.0);  // ad_V A
  const rbd::Half6<double> A = joint_axis(k, X_[at(i)]);
  const rbd::Half6<double> coad = coadjoint(A, H);
  JointRow<SE3> j;
  j.b = {(1 / h_) * A + 0.5 * turn, 0.5 * A.a};
  j.e = {0.5 * coad,
         k.prismatic ? Vec3<double>{0, 0, -0.5 * k.outer_mass} : Vec3<double>{0.5 * m.y, -0.5 * m.x, 0}};
  j.l = {A - half * turn, -half * cross(g, A.a)};
  j.k.h = half * coad;
  if (k.prismatic) {
    j.k.m = -half * k.outer_mass * cross(A.l, g);
  } else {
    j.k.m = -half * (g.z * m - dot(m, g) * A.a);
  }
  j.c = diagonal(i, d);
  j.K[0][0] = lie::full(k.I_o);
  j.K[0][1] = lie::hat3(k.h);
  j.K[1][0] = transpose(j.K[0][1]);
  j.K[1][1] = {{k.mass, 0, 0}, {0, k.mass, 0}, {0, 0, k.mass}};
  return j;
}

/// The same in the plane's axes, where e_3 x turns by a quarter.
template <>
JointRow<SE2> MidpointStep<SE2>::row(int i, double d) const noexcept {
  using lie::Vec2;
  const rbd::PlanarLink& k = chain_[i];
  const rbd::PlanarFrame<double>& X = X_[at(i)];
  const rbd::Half3<double>&V = V_[at(i)], &H = H_[at(i)];
  const Vec2<double>&g = g_[at(i)], &m = moment_[at(i)];
  const double half = 0.5 * h_;
  const rbd::Half3<double> A = joint_axis(k, X), turn = bracket_with_axis(k, X, V, 1.0),
                           coad = coadjoint(A, H);
  const rbd::Half3<double> twist = (1 / h_) * A + 0.5 * turn, row = A - half * turn;
  const Vec2<double> e_m = k.prismatic ? (-0.5 * k.outer_mass) * A.l : turned(-0.5 * k.sign, m);
  const Vec2<double> l_m = turned(half * A.a, g);
  JointRow<SE2> j;
  j.b << twist.a, twist.l.x, twist.l.y, 0.5 * A.a;
  j.e << 0.5 * coad.a, 0.5 * coad.l.x, 0.5 * coad.l.y, e_m.x, e_m.y;
  j.l << row.a, row.l.x, row.l.y, l_m.x, l_m.y;
  j.k << half * coad.a, half * coad.l.x, half * coad.l.y,
      k.prismatic ? -half * k.outer_mass * cross(A.l, g) : half * k.sign * dot(m, g);
  j.c = diagonal(i, d);
  j.K << k.I_o, -X.h.y, X.h.x, -X.h.y, k.mass, 0, X.h.x, 0, k.mass;
  return j;
}

template double MidpointStep<SE3>::diagonal(int, double) const noexcept;
template double MidpointStep<SE2>::diagonal(int, double) const noexcept;

}  // namespace hamel::dynamics
