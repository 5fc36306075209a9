#include "services/planner/core/barrier.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "services/planner/core/force_law.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

// A row that joints act on with less than this part of the end effector's mobility is one nothing can be done
// about (an obstacle coming at the pedestal): trying would throw the arm about.
constexpr double kImmovable = 1e-4;
constexpr double kWildest = 1e3;       // no joint is accelerated harder by the barrier [rad/s^2 or m/s^2]
constexpr double kLimitHorizon = 0.5;  // joint rows begin so far from a limit [rad or m]

}  // namespace

double distance_curvature(const Pair& pair, const Vector3d& omega_link) noexcept {
  const geometry::Closest& c = pair.at;
  const geometry::Obstacle& o = pair.item->now;
  const Vector3d omega_o = o.V_WO.head<3>();
  const bool flat = !std::isfinite(c.centre_m);  // the obstacle's face
  if (flat && omega_o.isZero(0)) return 0;
  const double apart = flat ? (c.on_obstacle - c.on_axis).norm() : c.centre_m;
  const double D = std::max(apart, kNearest_m);
  const Vector3d v_axis = pair.v - omega_link.cross(c.on_link - c.on_axis);
  const Vector3d v_centre = o.V_WO.tail<3>() + omega_o.cross(c.on_axis + apart * pair.n - o.X_WO.p);
  const Vector3d w = v_centre - v_axis;
  // A face that turns: d = n.(y - x) with a normal of the link's or of the obstacle's own.
  if (flat || !c.link_axis2.isZero() || !c.obstacle_axis2.isZero()) {
    const Vector3d turn = (c.link_axis2.isZero() ? omega_o : omega_link).cross(pair.n);
    return 2 * turn.dot(w) - D * turn.squaredNorm();
  }
  const double along = pair.n.dot(w);
  const double F_tautau = (w.squaredNorm() - along * along) / D;
  const bool slides_there = !c.obstacle_axis.isZero();
  const double m_link =
      c.slides_on_link ? -(c.link_axis.dot(w) / D + pair.n.dot(omega_link.cross(c.link_axis))) : 0;
  const double m_there =
      slides_there ? c.obstacle_axis.dot(w) / D + pair.n.dot(omega_o.cross(c.obstacle_axis)) : 0;
  // H = [1, -cos; -cos, 1]/D between two lines, 1/D for one; nearly parallel lines count as one.
  const double cosine = c.slides_on_link && slides_there ? c.link_axis.dot(c.obstacle_axis) : 0;
  const double sine2 = 1 - cosine * cosine;
  if (sine2 < 1e-6) return F_tautau - D * m_link * m_link;
  return F_tautau - D * (m_link * m_link + 2 * cosine * m_link * m_there + m_there * m_there) / sine2;
}

Barrier::Barrier(const Arm& arm, const scene::PlannerOptions& options)
    : options_(options), least_norm_(arm.n(), static_cast<Eigen::Index>(Pairs::kMost) + 4 * arm.n()) {
  const Eigen::Index most = static_cast<Eigen::Index>(Pairs::kMost) + 4 * arm.n();
  A_ = Eigen::MatrixXd::Zero(arm.n(), most + 1);  // one spare: a row is written before it is judged
  C_ = A_;
  b_ = s_ = length_ = VectorXd::Zero(most + 1);
  x_ = VectorXd::Zero(arm.n());
  pair_of_row_.reserve(Pairs::kMost);
}

// A_.col(rows_) is filled; finishes the row unless nothing can act on it.
void Barrier::add_row(const Arm& arm, double b, double least_mobility) noexcept {
  auto c = C_.col(rows_);
  c = A_.col(rows_);
  arm.M_llt.matrixL().solveInPlace(c);
  const double length = c.norm();
  if (!(length * length > least_mobility) || !std::isfinite(b)) return;
  c /= length;
  length_[rows_] = length;
  b_[rows_] = b;
  ++rows_;
}

void Barrier::add_pair_rows(const Arm& arm, Pairs& pairs) noexcept {
  const double g = options_.barrier_gain;
  const auto items = pairs.guarded();
  pair_of_row_.clear();
  const auto J_tip = arm.J_E.bottomRows<3>();
  const double least = kImmovable * J_tip.cwiseProduct(J_tip.lazyProduct(arm.M_inverse)).sum();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    pair.multiplier = 0;
    const Vector3d omega = arm.angular_velocity(pair.link);
    const Vector3d bias = pairs.bias(arm, pair);
    const double h = pair.d - options_.dmin_m, hd = -pair.n.dot(pair.v_relative);
    const double curvature = std::min(distance_curvature(pair, omega), 0.0);
    A_.col(rows_).noalias() = -pairs.J(k).transpose().lazyProduct(pair.n);
    const Eigen::Index before = rows_;
    add_row(arm, -2 * g * hd - g * g * h + pair.n.dot(bias) - curvature, least);
    if (rows_ > before) pair_of_row_.push_back(k);
  }
}

void Barrier::add_joint_rows(const Arm& arm) noexcept {
  const double g = options_.barrier_gain;
  const auto row = [&](int j, double sign, double b) {  // sign * a_j >= b
    A_.col(rows_).setZero();
    A_(j, rows_) = sign;
    add_row(arm, b, 0);
  };
  for (int j = 0; j < arm.n(); ++j) {
    const model::JointLimits& limits = arm.chain.joint(j).limits;
    const double q = arm.q[j], qd = arm.qd[j], near = std::max(kLimitHorizon, 2 * std::abs(qd) / g);
    if (q - limits.lower < near) row(j, 1, -2 * g * qd - g * g * (q - limits.lower));
    if (limits.upper - q < near) row(j, -1, 2 * g * qd - g * g * (limits.upper - q));
    if (-qd > 0.5 * limits.velocity) row(j, 1, -g * (limits.velocity + qd));
    if (qd > 0.5 * limits.velocity) row(j, -1, -g * (limits.velocity - qd));
  }
}

Barrier::Outcome Barrier::solve(const Arm& arm, Pairs& pairs, VectorXd& a) noexcept {
  rows_ = 0;
  add_pair_rows(arm, pairs);
  add_joint_rows(arm);
  for (Eigen::Index i = 0; i < rows_; ++i) s_[i] = (b_[i] - A_.col(i).dot(a)) / length_[i];
  const LeastNorm::Outcome found = least_norm_.solve(C_, s_, rows_);
  Outcome outcome;
  outcome.rows = static_cast<int>(rows_);
  outcome.steps = least_norm_.steps();
  outcome.active = least_norm_.steps() > 0;
  outcome.infeasible = found != LeastNorm::Outcome::solved;
  x_ = least_norm_.x();
  arm.M_llt.matrixU().solveInPlace(x_);
  const double largest = x_.lpNorm<Eigen::Infinity>();
  if (largest > kWildest) {
    x_ *= kWildest / largest;
    outcome.infeasible = true;
  }
  a += x_;
  for (std::size_t r = 0; r < pair_of_row_.size(); ++r) {
    const auto row = static_cast<Eigen::Index>(r);  // pairs come first
    pairs.guarded()[pair_of_row_[r]].multiplier = least_norm_.multipliers()[row] / length_[row];
  }
  return outcome;
}

}  // namespace hamel::planner
