// The exact Jacobian of the midpoint step, joint by joint.
#include "services/dynamics/core/midpoint.h"

namespace hamel::dynamics {
namespace {

using lie::Mat3;
using lie::Vec2;
using lie::Vec3;

/// A twist or momentum in the axes that do not turn, with a turn or moment about the first two.
[[gnu::always_inline]] inline Column<8> column(const Vec3<double>& a, const Vec3<double>& l, double x,
                                               double y) {
  return {{Pair{{a.x, a.y}}, Pair{{a.z, l.x}}, Pair{{l.y, l.z}}, Pair{{x, y}}}};
}

/// Adds the inertia of a link.
[[gnu::always_inline]] inline void add_inertia(const lie::Sym3<double>& I, const Vec3<double>& h, double mass,
                                               JointRow<SE3>::Matrix& P) {
  const auto add = [&](std::size_t r, const Vec3<double>& a, const Vec3<double>& l) {
    P[r] = plus(column(a, l, 0, 0), 1, P[r]);
  };
  add(0, {I.xx, I.xy, I.xz}, {0, -h.z, h.y});
  add(1, {I.xy, I.yy, I.yz}, {h.z, 0, -h.x});
  add(2, {I.xz, I.yz, I.zz}, {-h.y, h.x, 0});
  add(3, {0, h.z, -h.y}, {mass, 0, 0});
  add(4, {-h.z, 0, h.x}, {0, mass, 0});
  add(5, {h.y, -h.x, 0}, {0, 0, mass});
}

}  // namespace

/// What damping, armature and stops add on the diagonal.
template <class G>
double MidpointStep<G>::diagonal(int i) const noexcept {
  const auto& k = chain_[i];
  return k.armature * rate_ + 0.5 * k.damping + 0.25 * h_ * stop_slope(k, options_.stop_stiffness, u_[i]);
}

/// One joint of the exact Jacobian.  With B = A/h + ad_V A / 2:
///   change of V:  X (V of the parent) + B x
///   turn:         R^T (turn of the parent) + (angular part of A) x / 2
///   change of h:  I (change of V) + X^T (change of h - ad_A^T h x / 2), and so for the first moment m
///   change of r:  A^T (change of h - (h/2)(ad_{change of V}^T h + ad_V^T (change of h) + change of w))
/// where w = (m x g, mass g) and a turn phi changes g by g x phi.
/// The torques of outer wrenches are left out: their change with d is of the next order in h.
template <>
[[gnu::always_inline]] inline JointRow<SE3> MidpointStep<SE3>::row(int i, const Mat3<double>& R,
                                                                   const Motion& H, const Direction& moment,
                                                                   Matrix& P) const noexcept {
  const auto& k = chain_[i];
  const Motion& V = V_[at(i)];
  // In the axes that do not turn: the joint's direction a, R (w x e_3), and w x g = gravity (w.y, -w.x, 0).
  const Vec3<double>& a = R.z;
  const auto across = [&](const Vec3<double>& w) { return w.y * R.x - w.x * R.y; };
  const double half = 0.5 * h_, fall = half * gravity_;
  const Vec3<double> none;
  const Motion A = k.prismatic ? Motion{none, a} : Motion{a, none};
  const Motion turn = k.prismatic ? Motion{none, across(V.a)} : Motion{across(V.a), across(V.l)};
  const Motion coad = k.prismatic ? Motion{across(H.l), none} : Motion{across(H.a), across(H.l)};
  const Vec3<double> lever = k.prismatic ? -k.outer_mass * a : across(moment);
  const Motion twist = rate_ * A + 0.5 * turn, row = A - half * turn;
  add_inertia(rotate(R, k.I_o), R * k.h, k.mass, P);
  return {{.b = column(twist.a, twist.l, 0.5 * A.a.x, 0.5 * A.a.y),
           .k = column(half * coad.a, half * coad.l, fall * lever.y, -fall * lever.x),
           .e = column(0.5 * coad.a, 0.5 * coad.l, 0.5 * lever.x, 0.5 * lever.y),
           .l = column(row.a, row.l, fall * A.a.y, -fall * A.a.x),
           .c = diagonal(i)}};
}

/// The same in the plane's axes, where e_3 x turns by a quarter.
template <>
[[gnu::always_inline]] inline JointRow<SE2> MidpointStep<SE2>::row(int i, const rbd::NoAttitude&,
                                                                   const Motion& H, const Direction& m,
                                                                   Matrix& P) const noexcept {
  const rbd::PlanarLink& k = chain_[i];
  const rbd::PlanarFrame<double>& X = X_[at(i)];
  const Direction& g = chain_.gravity_W;
  const double half = 0.5 * h_;
  const Motion A = joint_axis(k, X), turn = bracket_with_axis(k, X, V_[at(i)], 1.0), coad = coadjoint(A, H);
  const Motion twist = rate_ * A + 0.5 * turn, row = A - half * turn;
  const Vec2<double> e_m = k.prismatic ? (-0.5 * k.outer_mass) * A.l : turned(-0.5 * k.sign, m);
  const Vec2<double> l_m = turned(half * A.a, g);
  const double k_turn = k.prismatic ? -half * k.outer_mass * cross(A.l, g) : half * k.sign * dot(m, g);
  P[0].add(0, k.I_o), P[0].add(1, -X.h.y), P[0].add(2, X.h.x);
  P[1].add(0, -X.h.y), P[1].add(1, k.mass);
  P[2].add(0, X.h.x), P[2].add(2, k.mass);
  return {{.b = {{Pair{{twist.a, twist.l.x}}, Pair{{twist.l.y, 0.5 * A.a}}}},
           .k = {{Pair{{half * coad.a, half * coad.l.x}}, Pair{{half * coad.l.y, k_turn}}}},
           .e = {{Pair{{0.5 * coad.a, 0.5 * coad.l.x}}, Pair{{0.5 * coad.l.y, e_m.x}}, Pair{{e_m.y, 0}}}},
           .l = {{Pair{{row.a, row.l.x}}, Pair{{row.l.y, l_m.x}}, Pair{{l_m.y, 0}}}},
           .c = diagonal(i)}};
}

template <class G>
void MidpointStep<G>::linearise_and_solve() noexcept {
  Motion H;
  Direction moment;
  const auto row_of = [&](int i, const auto& R, Matrix& P) {
    const auto& k = chain_[i];
    const auto& X = X_[at(i)];
    H = H + momentum(k, X, V_[at(i)]);
    add_moment(k, X, moment);
    const JointRow<G> j = row(i, R, H, moment, P);
    H = to_parent(X, H);
    moment = moment_to_parent(k, X, moment);
    return j;
  };
  newton_.factorise_and_solve(X_, row_of, r_.data(), r_.data());
}

template void MidpointStep<SE3>::linearise_and_solve() noexcept;
template void MidpointStep<SE2>::linearise_and_solve() noexcept;

}  // namespace hamel::dynamics
