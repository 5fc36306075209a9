#include "services/planner/core/barrier.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "services/planner/core/force_law.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMostSweeps = 60;
constexpr double kRegularisation = 1e-6;  // of a row's own stiffness
constexpr double kSettled = 1e-9;         // a sweep that changes accelerations by less than this, relatively
constexpr double kViolated = 1e-2;        // relative; a row missed by more is infeasible
constexpr double kImmovable = 1e-12;      // a row no joint can act on
constexpr double kLimitHorizon = 0.5;     // joint rows begin so far from a limit [rad or m]

}  // namespace

double distance_curvature(const Pair& pair, const Vector3d& omega_link) noexcept {
  const geometry::Closest& c = pair.at;
  if (!std::isfinite(c.centre_m)) return 0;
  const geometry::Obstacle& o = pair.item->now;
  const double D = std::max(c.centre_m, kNearest_m);
  const Vector3d v_axis = pair.v - omega_link.cross(c.on_link - c.on_axis);
  const Vector3d omega_o = o.V_WO.head<3>();
  const Vector3d v_centre = o.V_WO.tail<3>() + omega_o.cross(c.on_axis + c.centre_m * pair.n - o.X_WO.p);
  const Vector3d w = v_centre - v_axis;
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

Barrier::Barrier(const Arm& arm, const scene::PlannerOptions& options) : options_(options) {
  const Eigen::Index most = static_cast<Eigen::Index>(kMaxPairs) + 4 * arm.n();
  A_ = Eigen::MatrixXd::Zero(arm.n(), most);
  Y_ = A_;
  b_ = diagonal_ = lambda_ = VectorXd::Zero(most);
  pair_of_row_.reserve(kMaxPairs);
}

// A_.col(rows_) is filled; finishes the row unless nothing can act on it.
void Barrier::add_row(const Arm& arm, double b) noexcept {
  Y_.col(rows_).noalias() = arm.M_inverse.lazyProduct(A_.col(rows_));
  const double stiffness = A_.col(rows_).dot(Y_.col(rows_));
  if (!(stiffness > kImmovable) || !std::isfinite(b)) return;
  diagonal_[rows_] = stiffness;
  b_[rows_] = b;
  lambda_[rows_] = 0;
  ++rows_;
}

void Barrier::add_pair_rows(const Arm& arm, Pairs& pairs) noexcept {
  const double g = options_.barrier_gain;
  const auto items = pairs.items();
  pair_of_row_.clear();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    pair.multiplier = 0;
    const Vector3d omega = arm.angular_velocity(pair.link);
    const Vector3d bias = rbd::point_bias_acceleration(arm.chain, arm.ws, pair.link, pair.at.on_axis, arm.qd);
    const double h = pair.d - options_.dmin_m, hd = -pair.n.dot(pair.v_relative);
    const double curvature = std::min(distance_curvature(pair, omega), 0.0);
    A_.col(rows_).noalias() = -pairs.J(k).transpose().lazyProduct(pair.n);
    const Eigen::Index before = rows_;
    add_row(arm, -2 * g * hd - g * g * h + pair.n.dot(bias) - curvature);
    if (rows_ > before) pair_of_row_.push_back(k);
  }
}

void Barrier::add_joint_rows(const Arm& arm) noexcept {
  const double g = options_.barrier_gain;
  const auto row = [&](int j, double sign, double b) {  // sign * a_j >= b
    A_.col(rows_).setZero();
    A_(j, rows_) = sign;
    add_row(arm, b);
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
  Outcome outcome;
  outcome.rows = static_cast<int>(rows_);
  const double scale = 1 + a.norm();
  for (bool moving = rows_ > 0; moving && outcome.sweeps < kMostSweeps; ++outcome.sweeps) {
    moving = false;
    for (Eigen::Index i = 0; i < rows_; ++i) {
      const double missing = b_[i] - A_.col(i).dot(a) - kRegularisation * diagonal_[i] * lambda_[i];
      const double next = std::max(0.0, lambda_[i] + missing / ((1 + kRegularisation) * diagonal_[i]));
      const double change = next - lambda_[i];
      if (change == 0) continue;
      lambda_[i] = next;
      a.noalias() += change * Y_.col(i);
      moving |= std::abs(change) * std::sqrt(diagonal_[i]) > kSettled * scale;
    }
  }
  for (Eigen::Index i = 0; i < rows_; ++i) {
    outcome.active |= lambda_[i] > 0;
    outcome.infeasible |= b_[i] - A_.col(i).dot(a) > kViolated * (1 + std::abs(b_[i]));
  }
  for (std::size_t r = 0; r < pair_of_row_.size(); ++r)
    pairs.items()[pair_of_row_[r]].multiplier = lambda_[static_cast<Eigen::Index>(r)];
  return outcome;
}

}  // namespace hamel::planner
