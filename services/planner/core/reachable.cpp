#include "services/planner/core/reachable.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "common/base/even.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int kFewStarts = 4;
constexpr int kStarts = 100, kSteps = 80;
constexpr double kTurn_m = 0.3;  // so much of a place a radian is worth

thread_local std::uint64_t searched = 0;

/// Inverse kinematics of one goal.
class Search {
 public:
  Search(const model::Chain& chain, const scene::Goal& goal)
      : chain_(chain), goal_(goal), pose_(goal.kind == scene::GoalKind::pose), ws_(chain), J_(6, chain.n()) {
    low_.resize(chain.n());
    high_.resize(chain.n());
    for (int i = 0; i < chain.n(); ++i) {
      // One turn is enough of a joint that has more; one with less may have it beyond pi.
      const double lower = chain.joint(i).limits.lower, upper = chain.joint(i).limits.upper;
      const bool turns = upper - lower > 2 * std::numbers::pi;
      low_[i] = turns ? std::max(lower, std::min(-std::numbers::pi, upper - 2 * std::numbers::pi)) : lower;
      high_[i] = turns ? low_[i] + 2 * std::numbers::pi : upper;
    }
  }

  // The k-th of configurations that fill the limits evenly.
  VectorXd start(int k) const {
    const std::vector<double> u = even_point(chain_.n(), k);
    return low_ + Eigen::Map<const VectorXd>(u.data(), chain_.n()).cwiseProduct(high_ - low_);
  }

  // The same posture inside the limits searched.
  VectorXd within_a_turn(const VectorXd& q) const {
    VectorXd out = q;
    for (int i = 0; i < chain_.n(); ++i) {
      constexpr double kTurn = 2 * std::numbers::pi;
      if (high_[i] - low_[i] >= kTurn) out[i] -= kTurn * std::floor((q[i] - low_[i]) / kTurn);
    }
    return out;
  }

  // What is left of the way at q: turned, moved; sets J_.
  Vector6d error(const VectorXd& q) {
    rbd::positions(chain_, q, ws_);
    X_WE_ = rbd::tip(chain_, ws_);
    rbd::frame_jacobian(chain_, ws_, chain_.n() - 1, X_WE_.p, J_);
    Vector6d e = Vector6d::Zero();
    e.tail<3>() = goal_.X_WG.p - X_WE_.p;
    if (pose_) {
      const Eigen::AngleAxisd turn(Eigen::Quaterniond(goal_.X_WG.R * X_WE_.R.transpose()).normalized());
      e.head<3>() = kTurn_m * turn.angle() * turn.axis();
      J_.topRows<3>() *= kTurn_m;
    } else {
      J_.topRows<3>().setZero();
    }
    return e;
  }

  // Levenberg-Marquardt, every step cut at the limits; a joint at its limit that would go on stays out of it.
  Vector6d descend(VectorXd& q, const std::function<bool()>& stop = {}) {
    Vector6d e = error(q);
    double damping = 1e-2;
    for (int k = 0; k < kSteps && e.norm() > 1e-4 && !(stop && stop()); ++k) {
      const VectorXd dq = step(q, e, damping);
      const VectorXd tried = (q + dq).cwiseMax(low_).cwiseMin(high_);
      const Vector6d left = error(tried);
      if (left.norm() < e.norm()) {
        const bool still = left.norm() > 0.9999 * e.norm();
        q = tried;
        e = left;
        damping = std::max(0.3 * damping, 1e-6);
        if (still) break;
      } else {
        damping *= 5;
        if (damping > 1e4) break;
        e = error(q);
      }
    }
    return e;
  }

 private:
  VectorXd step(const VectorXd& q, const Vector6d& e, double damping) {
    VectorXd dq;
    for (bool again = true; again;) {
      Eigen::Matrix<double, 6, 6> A = J_ * J_.transpose();
      A.diagonal().array() += damping;
      dq = J_.transpose() * A.ldlt().solve(e);
      again = false;
      for (int j = 0; j < chain_.n(); ++j) {
        const bool out = (q[j] >= high_[j] && dq[j] > 0) || (q[j] <= low_[j] && dq[j] < 0);
        if (out) J_.col(j).setZero(), again = true;
      }
    }
    return dq;
  }

  const model::Chain& chain_;
  const scene::Goal& goal_;
  const bool pose_;
  rbd::Workspace ws_;
  Eigen::MatrixXd J_;
  VectorXd low_, high_;
  lie::Pose X_WE_;
};

bool meets(const Vector6d& left, const scene::PlannerOptions& o) {
  return left.tail<3>().norm() <= 0.5 * o.goal_tolerance_m &&
         left.head<3>().norm() <= 0.5 * kTurn_m * o.goal_tolerance_rad;
}

}  // namespace

std::uint64_t goals_searched() noexcept { return searched; }

Reachability reachability(const model::Chain& chain, const ReachQuestion& question,
                          const scene::PlannerOptions& o, const std::function<bool()>& stop) {
  const scene::Goal& goal = question.goal;
  if (goal.kind == scene::GoalKind::joints) return {};
  ++searched;
  Search search(chain, goal);
  Reachability out{false, Vector3d::Zero()};
  double least = std::numeric_limits<double>::infinity();
  const bool begin = question.near.size() == chain.n() && question.near.allFinite();
  for (int k = begin ? -1 : 0; k < (begin ? kFewStarts : kStarts) && !(stop && stop()); ++k) {
    VectorXd q = k < 0 ? question.near : search.start(k);
    const Vector6d e = search.descend(q, stop);
    if (meets(e, o)) return {true, goal.X_WG.p};
    if (e.norm() < least) {
      least = e.norm();
      out.nearest_W = goal.X_WG.p - e.tail<3>();
    }
  }
  return out;
}

VectorXd configuration_at(const model::Chain& chain, const scene::Goal& goal, const scene::PlannerOptions& o,
                          const VectorXd& start) {
  Search search(chain, goal);
  VectorXd q = search.within_a_turn(start);
  const VectorXd turned = start - q;
  if (!meets(search.descend(q), o)) return {};
  return q + turned;
}

}  // namespace hamel::planner
