#include "services/planner/core/least_norm.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamel::planner {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDependent = 1e-7;  // a unit column nearer than this to the span of others lies in it
constexpr double kMet = 1e-9;        // a row missed by less, relatively, is met
constexpr int kMostSteps = 200;

}  // namespace

LeastNorm::LeastNorm(Eigen::Index dimension, Eigen::Index most_rows)
    : Q_(Eigen::MatrixXd::Zero(dimension, dimension)),
      R_(Q_),
      x_(Eigen::VectorXd::Zero(dimension)),
      u_(Eigen::VectorXd::Zero(most_rows)),
      z_(x_),
      r_(x_),
      y_(x_) {
  given_up_.resize(static_cast<std::size_t>(most_rows));
  active_.reserve(static_cast<std::size_t>(dimension) + 1);
  waiting_.reserve(static_cast<std::size_t>(dimension) + 1);
}

LeastNorm::Outcome LeastNorm::solve(const Eigen::MatrixXd& C, const Eigen::VectorXd& s,
                                    Eigen::Index rows) noexcept {
  start();
  std::fill(given_up_.begin(), given_up_.end(), char{0});
  steps_ = 0;
  Outcome outcome = Outcome::solved;
  for (;;) {
    const Eigen::Index p = least_violated(C, s, rows);
    if (p < 0) return outcome;
    if (take_in(C, s, p)) continue;
    if (steps_ >= kMostSteps) return Outcome::out_of_steps;
    outcome = Outcome::infeasible;
    given_up_[static_cast<std::size_t>(p)] = 1;  // and begin anew without it: x has already leaned toward it
    start();
  }
}

void LeastNorm::start() noexcept {
  x_.setZero();
  u_.setZero();
  active_.clear();
}

Eigen::Index LeastNorm::least_violated(const Eigen::MatrixXd& C, const Eigen::VectorXd& s,
                                       Eigen::Index rows) const noexcept {
  Eigen::Index cheapest = -1;
  double least = kInfinity;
  for (Eigen::Index i = 0; i < rows; ++i) {
    if (given_up_[static_cast<std::size_t>(i)]) continue;
    const double missing = s[i] - C.col(i).dot(x_);
    if (missing < least && missing > kMet * (1 + std::abs(s[i]))) least = missing, cheapest = i;
  }
  return cheapest;
}

// Moves x along the part of row p that the active rows leave free until p holds, dropping active rows whose
// multiplier would turn negative on the way.  False: none can be dropped and nothing is free.
bool LeastNorm::take_in(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, Eigen::Index p) noexcept {
  for (; steps_ < kMostSteps; ++steps_) {
    z_ = C.col(p);
    project();
    double until_dropped = kInfinity;
    std::size_t leaving = 0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const double r = r_[static_cast<Eigen::Index>(k)];
      if (r > 0 && u_[active_[k]] / r < until_dropped) until_dropped = u_[active_[k]] / r, leaving = k;
    }
    const double free = z_.norm();
    const bool movable = free > kDependent && active_.size() < static_cast<std::size_t>(x_.size());
    const double until_met = movable ? (s[p] - C.col(p).dot(x_)) / (free * free) : kInfinity;
    const double step = std::min(until_dropped, until_met);
    if (step == kInfinity) return false;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      double& u = u_[active_[k]];
      u = std::max(0.0, u - step * r_[static_cast<Eigen::Index>(k)]);
    }
    u_[p] += step;
    if (movable) x_ += step * z_;
    if (until_met <= until_dropped) {
      append(p);
      ++steps_;
      return true;
    }
    drop(C, leaving);
  }
  return false;
}

// Splits z = c: what is off the active columns stays in z, their share becomes r, R r = y = Q^T c.  Projected
// twice, for digits.
void LeastNorm::project() noexcept {
  const auto k = static_cast<Eigen::Index>(active_.size());
  y_.head(k).setZero();
  for (int pass = 0; pass < 2; ++pass)
    for (Eigen::Index i = 0; i < k; ++i) {
      const double along = Q_.col(i).dot(z_);
      y_[i] += along;
      z_ -= along * Q_.col(i);
    }
  for (Eigen::Index i = k; i-- > 0;) {
    double sum = y_[i];
    for (Eigen::Index j = i + 1; j < k; ++j) sum -= R_(i, j) * r_[j];
    r_[i] = sum / R_(i, i);
  }
}

// Row p becomes active; z_ and y_ are those of its column.
void LeastNorm::append(Eigen::Index row) noexcept {
  const auto k = static_cast<Eigen::Index>(active_.size());
  R_.col(k).head(k) = y_.head(k);
  R_(k, k) = z_.norm();
  Q_.col(k) = z_ / R_(k, k);
  active_.push_back(row);
}

void LeastNorm::drop(const Eigen::MatrixXd& C, std::size_t k) noexcept {
  u_[active_[k]] = 0;
  active_.erase(active_.begin() + static_cast<std::ptrdiff_t>(k));
  // The columns after it are orthogonalised anew: there are few.
  waiting_.assign(active_.begin() + static_cast<std::ptrdiff_t>(k), active_.end());
  active_.resize(k);
  for (const Eigen::Index row : waiting_) {
    z_ = C.col(row);
    project();
    append(row);
  }
}

}  // namespace hamel::planner
