#include "services/planner/core/barrier.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/planner/core/force_law.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kLimitHorizon = 0.5;  // joint rows begin so far from a limit [rad or m]

constexpr double kGainPerStep = 0.25;  // gain times period at most: beyond it a step overshoots

// What a miss of 1 m/s^2 (rad/s^2, N m) costs: price/2 its square, beside 1/2 (a - a0)^T M (a - a0).  A
// distance under a push of 100 N is missed by 100 N/price/g^2, below 0.1 mm; one that joints hardly act on
// (an obstacle coming at the pedestal) is missed before it throws the arm about.
constexpr double kDistancePrice = 1e4;
constexpr double kSpeedPrice = 1;
constexpr double kJointPrice = 1e6;
constexpr double kTorquePrice = 1e6;
constexpr double kLeastGive = 1e-7;

/// How much nearer two lines come by sliding on each other, whose distance is
///   F = tau (m_link s + m_there t) + (s^2 - 2 cosine s t + t^2)/(2 D)  after tau, |s| and |t| bounded.
struct Sliding {
  double m_link = 0, m_there = 0, most_link = 0, most_there = 0, cosine = 0;

  double least(double tau, double D) const noexcept {
    const double b_s = -tau * D * m_link, b_t = -tau * D * m_there, sine2 = 1 - cosine * cosine;
    const auto F = [&](double s, double t) {
      return (-b_s * s - b_t * t + 0.5 * (s * s - 2 * cosine * s * t + t * t)) / D;
    };
    if (sine2 > 1e-12) {
      const double s = (b_s + cosine * b_t) / sine2, t = (b_t + cosine * b_s) / sine2;
      if (std::abs(s) <= most_link && std::abs(t) <= most_there) return F(s, t);
    }
    double least = 0;  // on the border
    for (const double sign : {-1.0, 1.0}) {
      const double s = sign * most_link, t = sign * most_there;
      least = std::min(least, F(s, std::clamp(b_t + cosine * s, -most_there, most_there)));
      least = std::min(least, F(std::clamp(b_s + cosine * t, -most_link, most_link), t));
    }
    return least;
  }
};

}  // namespace

double distance_curvature(const Pair& pair, const Vector3d& omega_link, double within_s) noexcept {
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
  Sliding s;
  if (c.slides_on_link) {
    s.m_link = -(c.link_axis.dot(w) / D + pair.n.dot(omega_link.cross(c.link_axis)));
    s.most_link = pair.span_m;
  }
  if (slides_there) {
    s.m_there = c.obstacle_axis.dot(w) / D + pair.n.dot(omega_o.cross(c.obstacle_axis));
    s.most_there = 2 * pair.item->solid.bound_m;
  }
  if (c.slides_on_link && slides_there) s.cosine = c.link_axis.dot(c.obstacle_axis);
  return F_tautau + 2 / (within_s * within_s) * s.least(within_s, D);
}

Barrier::Barrier(const Arm& arm, const scene::PlannerOptions& options)
    : options_(options), least_norm_(arm.n(), static_cast<Eigen::Index>(Pairs::kMost) + 8 * arm.n()) {
  const Eigen::Index most = static_cast<Eigen::Index>(Pairs::kMost) + 8 * arm.n();
  A_ = Eigen::MatrixXd::Zero(arm.n(), most);
  C_ = A_;
  L_inverse_ = Eigen::MatrixXd::Identity(arm.n(), arm.n());
  b_ = s_ = length_ = give_ = VectorXd::Zero(most);
  x_ = VectorXd::Zero(arm.n());
  pair_of_row_.reserve(Pairs::kMost);
}

// A_.col(rows_) and C_.col(rows_) = L^-1 of it are filled, where M = L L^T; finishes the row unless nothing
// can act on it.
void Barrier::add_row(double b, double price) noexcept {
  auto c = C_.col(rows_);
  const double length = c.norm();
  if (!(length > 1e-9) || !std::isfinite(length) || !std::isfinite(b)) return;
  c /= length;
  length_[rows_] = length;
  give_[rows_] = std::max(1 / (price * length * length), kLeastGive);
  b_[rows_] = b;
  ++rows_;
}

void Barrier::add_pair_rows(const Arm& arm, Pairs& pairs) noexcept {
  const double g = gain_;
  const auto items = pairs.guarded();
  pair_of_row_.clear();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    pair.multiplier = 0;
    const Vector3d omega = arm.angular_velocity(pair.link);
    const Vector3d bias = pairs.bias(arm, pair);
    const double h = pair.d - options_.dmin_m, hd = -pair.n.dot(pair.v_relative);
    const double curvature = std::min(distance_curvature(pair, omega, 1 / g), 0.0);
    A_.col(rows_).noalias() = -pairs.J(k).transpose().lazyProduct(pair.n);
    C_.col(rows_) = A_.col(rows_);
    arm.M_llt.matrixL().solveInPlace(C_.col(rows_));
    const Eigen::Index before = rows_;
    add_row(-2 * g * hd - g * g * h + pair.n.dot(bias) - curvature, kDistancePrice);
    if (rows_ > before) pair_of_row_.push_back(k);
  }
}

// Limits of position like distances; speed may close half of what is left to its limit in a time 1/g, and in
// one period never all of it.
void Barrier::add_joint_rows(const Arm& arm, double dt_s) noexcept {
  const double g = gain_, rate = std::min(g, 1 / dt_s);
  L_inverse_.setIdentity();
  for (int j = 0; j < arm.n(); ++j) arm.M_llt.matrixL().solveInPlace(L_inverse_.col(j));
  const auto row = [&](int j, double sign, double b, double price) {  // sign * a_j >= b
    A_.col(rows_).setZero();
    A_(j, rows_) = sign;
    C_.col(rows_) = sign * L_inverse_.col(j);
    add_row(b, price);
  };
  for (int j = 0; j < arm.n(); ++j) {
    const model::JointLimits& limits = arm.chain.joint(j).limits;
    // Braking from full speed along h.. + 2 g h. + g^2 h = 0 takes at most g v/e.
    const double most = std::numbers::e * acceleration_limit(arm, j) / limits.velocity;
    const double gj = most > 0 ? std::min(g, most) : g;
    const double q = arm.q[j], qd = arm.qd[j], near = std::max(kLimitHorizon, 2 * std::abs(qd) / gj);
    if (q - limits.lower < near) row(j, 1, -2 * gj * qd - gj * gj * (q - limits.lower), kJointPrice);
    if (limits.upper - q < near) row(j, -1, 2 * gj * qd - gj * gj * (limits.upper - q), kJointPrice);
  }
  hard_rows_ = rows_;
  for (int j = 0; j < arm.n(); ++j) {
    const double most = acceleration_limit(arm, j), speed = arm.chain.joint(j).limits.velocity;
    row(j, 1, std::clamp(-rate * (speed + arm.qd[j]), -most, most), kSpeedPrice);
    row(j, -1, std::clamp(-rate * (speed - arm.qd[j]), -most, most), kSpeedPrice);
  }
}

double Barrier::acceleration_limit(const Arm& arm, int j) const noexcept {
  return std::min(arm.chain.joint(j).limits.acceleration, options_.amax);
}

// |M a + c + gravity| <= effort.
void Barrier::add_torque_rows(const Arm& arm) noexcept {
  torque_row_ = rows_;
  for (int j = 0; j < arm.n(); ++j) {
    const double limit = arm.chain.joint(j).limits.effort, rest = arm.coriolis[j] + arm.gravity[j];
    if (!std::isfinite(limit)) continue;
    for (const double sign : {1.0, -1.0}) {
      A_.col(rows_) = sign * arm.M.col(j);
      C_.col(rows_).setZero();
      C_.col(rows_).head(j + 1) =
          sign * arm.M_llt.matrixLLT().row(j).head(j + 1).transpose();  // L^-1 M = L^T
      add_row(-limit - sign * rest, kTorquePrice);
    }
  }
}

// Takes a to the minimum under the rows there are; false where the search for it did not end.
bool Barrier::settle(const Arm& arm, VectorXd& a) noexcept {
  for (Eigen::Index i = 0; i < rows_; ++i) s_[i] = (b_[i] - A_.col(i).dot(a)) / length_[i];
  const bool solved = least_norm_.solve(C_, s_, give_, rows_);
  x_ = least_norm_.x();
  arm.M_llt.matrixU().solveInPlace(x_);
  a += x_;
  return solved;
}

void Barrier::keep_torque(const Arm& arm, VectorXd& a) noexcept {
  rows_ = 0;
  add_torque_rows(arm);
  (void)settle(arm, a);
}

Barrier::Outcome Barrier::solve(const Arm& arm, Pairs& pairs, double dt_s, VectorXd& a) noexcept {
  rows_ = 0;
  gain_ = std::min(options_.barrier_gain, kGainPerStep / dt_s);
  add_pair_rows(arm, pairs);
  add_joint_rows(arm, dt_s);
  add_torque_rows(arm);
  const bool solved = settle(arm, a);
  const VectorXd& u = least_norm_.multipliers();
  Outcome outcome;
  outcome.rows = static_cast<int>(rows_);
  outcome.active = least_norm_.steps() > 0;
  // A miss m for ever costs m/g^2 of distance.
  const double g = gain_, afford = 0.5 * g * g * std::max(options_.dmin_m, 1e-3);
  outcome.infeasible = !solved;
  for (Eigen::Index i = 0; i < hard_rows_; ++i)
    if (give_[i] * u[i] * length_[i] > afford) outcome.infeasible = true;
  for (Eigen::Index i = torque_row_; i < rows_; ++i) outcome.torque_bound |= u[i] > 0;
  for (int j = 0; j < arm.n(); ++j) {
    const double most = kMostOver * acceleration_limit(arm, j), wanted = a[j];
    a[j] = std::clamp(wanted, -most, most);
    outcome.infeasible |= a[j] != wanted;
  }
  for (std::size_t r = 0; r < pair_of_row_.size(); ++r) {
    const auto row = static_cast<Eigen::Index>(r);  // pairs come first
    pairs.guarded()[pair_of_row_[r]].multiplier = u[row] / length_[row];
  }
  return outcome;
}

}  // namespace hamel::planner
