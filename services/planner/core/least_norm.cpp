#include "services/planner/core/least_norm.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamel::planner {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMet = 1e-9;  // a row missed by less, relatively, is met
constexpr int kMostSteps = 300;
constexpr Eigen::Index kMostActive = 64;

}  // namespace

LeastNorm::LeastNorm(Eigen::Index dimension, Eigen::Index most_rows)
    : R_(Eigen::MatrixXd::Zero(kMostActive, kMostActive)),
      x_(Eigen::VectorXd::Zero(dimension)),
      u_(Eigen::VectorXd::Zero(most_rows)),
      z_(x_),
      r_(Eigen::VectorXd::Zero(kMostActive)),
      y_(r_) {
  active_.reserve(kMostActive);
  waiting_.reserve(kMostActive);
}

bool LeastNorm::solve(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, const Eigen::VectorXd& give,
                      Eigen::Index rows) noexcept {
  x_.setZero();
  u_.setZero();
  active_.clear();
  for (steps_ = 0;;) {
    const Eigen::Index p = most_violated(C, s, give, rows);
    if (p < 0) return true;
    if (!take_in(C, s, give, p)) return false;
  }
}

Eigen::Index LeastNorm::most_violated(const Eigen::MatrixXd& C, const Eigen::VectorXd& s,
                                      const Eigen::VectorXd& give, Eigen::Index rows) const noexcept {
  Eigen::Index worst = -1;
  double most = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double missing = s[i] - C.col(i).dot(x_) - give[i] * u_[i];
    if (missing > most && missing > kMet * (1 + std::abs(s[i]))) most = missing, worst = i;
  }
  return worst;
}

// Raises u[p] until row p holds, dropping active rows whose multiplier would turn negative on the way.
bool LeastNorm::take_in(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, const Eigen::VectorXd& give,
                        Eigen::Index p) noexcept {
  for (; steps_ < kMostSteps; ++steps_) {
    project(C, give, p);
    double until_dropped = kInfinity;
    std::size_t leaving = 0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const double r = r_[static_cast<Eigen::Index>(k)];
      if (r > 0 && u_[active_[k]] / r < until_dropped) until_dropped = u_[active_[k]] / r, leaving = k;
    }
    const double until_met = (s[p] - C.col(p).dot(x_) - give[p] * u_[p]) / free_;
    const double step = std::min(until_dropped, until_met);
    for (std::size_t k = 0; k < active_.size(); ++k) {
      double& u = u_[active_[k]];
      u = std::max(0.0, u - step * r_[static_cast<Eigen::Index>(k)]);
    }
    u_[p] += step;
    x_ += step * z_;
    if (until_met <= until_dropped) {
      if (static_cast<Eigen::Index>(active_.size()) == kMostActive) return false;
      append(p);
      ++steps_;
      return true;
    }
    drop(C, give, leaving);
  }
  return false;
}

// How the active rows answer row p: y = R^-T C_A^T c_p, r = R^-1 y; z = c_p - C_A r; free = 1 + give - |y|^2.
void LeastNorm::project(const Eigen::MatrixXd& C, const Eigen::VectorXd& give, Eigen::Index p) noexcept {
  const auto k = static_cast<Eigen::Index>(active_.size());
  for (Eigen::Index i = 0; i < k; ++i) {
    double sum = C.col(active_[static_cast<std::size_t>(i)]).dot(C.col(p));
    for (Eigen::Index j = 0; j < i; ++j) sum -= R_(j, i) * y_[j];
    y_[i] = sum / R_(i, i);
  }
  for (Eigen::Index i = k; i-- > 0;) {
    double sum = y_[i];
    for (Eigen::Index j = i + 1; j < k; ++j) sum -= R_(i, j) * r_[j];
    r_[i] = sum / R_(i, i);
  }
  z_ = C.col(p);
  for (Eigen::Index i = 0; i < k; ++i) z_ -= r_[i] * C.col(active_[static_cast<std::size_t>(i)]);
  // Two ways to the same number: the first loses digits to rounding, the second cannot fall below `give`.
  free_ = std::max(1 + give[p] - y_.head(k).squaredNorm(), give[p]);
}

// Row p becomes active; y_ and free_ are those of its column.
void LeastNorm::append(Eigen::Index row) noexcept {
  const auto k = static_cast<Eigen::Index>(active_.size());
  R_.col(k).head(k) = y_.head(k);
  R_(k, k) = std::sqrt(free_);
  active_.push_back(row);
}

void LeastNorm::drop(const Eigen::MatrixXd& C, const Eigen::VectorXd& give, std::size_t k) noexcept {
  u_[active_[k]] = 0;
  active_.erase(active_.begin() + static_cast<std::ptrdiff_t>(k));
  // The columns after it are factored anew: there are few.
  waiting_.assign(active_.begin() + static_cast<std::ptrdiff_t>(k), active_.end());
  active_.resize(k);
  for (const Eigen::Index row : waiting_) {
    project(C, give, row);
    append(row);
  }
}

}  // namespace hamel::planner
