#pragma once
/// The shortest vector that meets linear inequalities as nearly as they can be met: a dual active-set method
/// (Goldfarb, Idnani 1983) with a price on every miss.  Exact in finitely many steps.

#include <Eigen/Core>
#include <vector>

namespace hamel::planner {

class LeastNorm {
 public:
  LeastNorm(Eigen::Index dimension, Eigen::Index most_rows);

  /// min |x|^2 + sum miss[i]^2 / give[i]  subject to  C.col(i) . x + miss[i] >= s[i] for i < rows.
  /// @param C     columns are unit vectors (dimension x at least rows)
  /// @param give  > 0: how easily row i gives way; miss[i] = give[i] u[i] with the multiplier u >= 0 and
  ///              x = sum u[i] C.col(i).  Rows that agree are missed by about give * |s|, rows that
  ///              contradict each other share the miss in proportion to theirs
  /// @return false: out of steps, x meets some rows only (kMostSteps; not seen with give >= 1e-9)
  /// Cost O(dimension k + k^2) a step, k active rows.  No allocation.
  bool solve(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, const Eigen::VectorXd& give,
             Eigen::Index rows) noexcept;

  const Eigen::VectorXd& x() const noexcept { return x_; }
  const Eigen::VectorXd& multipliers() const noexcept { return u_; }
  int steps() const noexcept { return steps_; }

 private:
  Eigen::Index most_violated(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, const Eigen::VectorXd& give,
                             Eigen::Index rows) const noexcept;
  bool take_in(const Eigen::MatrixXd& C, const Eigen::VectorXd& s, const Eigen::VectorXd& give,
               Eigen::Index p) noexcept;
  void project(const Eigen::MatrixXd& C, const Eigen::VectorXd& give, Eigen::Index p) noexcept;
  void append(Eigen::Index row) noexcept;
  void drop(const Eigen::MatrixXd& C, const Eigen::VectorXd& give, std::size_t k) noexcept;

  std::vector<Eigen::Index> active_, waiting_;  ///< rows that hold with equality; scratch
  Eigen::MatrixXd R_;                           ///< R^T R = C^T C + diag(give) of the active rows
  Eigen::VectorXd x_, u_, z_, r_, y_;           ///< z: how x moves as u[p] grows; r: how the active u fall
  double free_ = 0;                             ///< how row p gains as u[p] grows
  int steps_ = 0;
};

}  // namespace hamel::planner
