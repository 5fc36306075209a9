#pragma once
/// The shortest vector that meets linear inequalities: a dual active-set method (Goldfarb, Idnani 1983) for
/// the identity metric.  Exact in finitely many steps, and it knows when the inequalities contradict each
/// other.

#include <Eigen/Core>
#include <vector>

namespace hamel::planner {

class LeastNorm {
 public:
  LeastNorm(Eigen::Index dimension, Eigen::Index most_rows);

  enum class Outcome { solved, infeasible, out_of_steps };
  /// min |x|  subject to  C.col(i) . x >= s[i] for i < rows.
  /// @param C  columns are unit vectors (dimension x at least rows)
  /// Infeasible: x meets the rows that could be met; the cheapest were taken in first, and a row that
  /// contradicts them was given up.  O(dimension k^2) a step, k active rows.  No allocation.
  Outcome solve(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, Eigen::Index rows) noexcept;

  const Eigen::VectorXd& x() const noexcept { return x_; }
  /// u >= 0 with x = sum u[i] C.col(i).
  const Eigen::VectorXd& multipliers() const noexcept { return u_; }
  int steps() const noexcept { return steps_; }

 private:
  void start() noexcept;
  Eigen::Index least_violated(const Eigen::MatrixXd& C, const Eigen::VectorXd& s,
                              Eigen::Index rows) const noexcept;
  bool take_in(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, Eigen::Index p) noexcept;
  void project() noexcept;
  void append(Eigen::Index row) noexcept;
  void drop(const Eigen::MatrixXd& C, std::size_t k) noexcept;

  std::vector<Eigen::Index> active_, waiting_;  ///< rows that hold with equality; scratch
  Eigen::MatrixXd Q_, R_;                       ///< their columns = Q R, Q orthonormal
  Eigen::VectorXd x_, u_, z_, r_, y_;  ///< z: part of a column off the active ones; r: its part along them
  std::vector<char> given_up_;
  int steps_ = 0;
};

}  // namespace hamel::planner
