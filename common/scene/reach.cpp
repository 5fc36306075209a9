#include "common/scene/reach.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamel::scene {
namespace {

using Eigen::Vector3d;

constexpr double kSlack_m = 1e-8;  // rounding of distances
constexpr double kNear_m = 0.1;    // what sift_near() found is good for so far a way of each link

/// The point of joint 0's axis next to p (both in link 0's frame), which does not move; for a slide the
/// origin.
Vector3d pivot(const model::Joint& first, const Vector3d& p) {
  if (first.kind == model::JointKind::prismatic) return Vector3d::Zero();
  return first.axis * first.axis.dot(p);
}

ReachBall ball_of(const model::Chain& chain, int link, const geometry::Capsule& capsule_B) {
  const lie::Pose X_W0 = chain.X_WB0() * chain.joint(0).X_PJ;
  const auto extent = [&](const Vector3d& from) {
    return std::max((capsule_B.p0 - from).norm(), (capsule_B.p1 - from).norm());
  };
  if (link < 0) {
    const Vector3d middle = 0.5 * (capsule_B.p0 + capsule_B.p1);
    return {link, chain.X_WB0() * middle, extent(middle), capsule_B.radius_m};
  }
  ReachBall ball;
  ball.link = link;
  ball.radius_m = capsule_B.radius_m;
  ball.axis_m = travel_m(chain.joint(0));
  if (link == 0) {
    const Vector3d c = pivot(chain.joint(0), 0.5 * (capsule_B.p0 + capsule_B.p1));
    ball.centre_W = X_W0 * c;
    ball.axis_m += extent(c);
    return ball;
  }
  const Vector3d c = pivot(chain.joint(0), chain.joint(1).X_PJ.p);
  ball.centre_W = X_W0 * c;
  ball.axis_m += (chain.joint(1).X_PJ.p - c).norm() + travel_m(chain.joint(1)) + extent(Vector3d::Zero());
  for (int j = 2; j <= link; ++j) ball.axis_m += chain.joint(j).X_PJ.p.norm() + travel_m(chain.joint(j));
  return ball;
}

/// The ball about the shoulder within which a target counts as reachable, with the last link about it however
/// turned.
ReachBall target_ball(const Robot& robot, const PlannerOptions& options) {
  const model::Chain& chain = robot.chain;
  ReachBall ball;
  ball.link = chain.n() - 1;
  ball.centre_W = chain.X_WB0() * chain.joint(0).X_PJ.p;
  ball.axis_m = chain.X_NE().p.norm() + options.goal_tolerance_m + travel_m(chain.joint(0));
  for (int j = 1; j < chain.n(); ++j) ball.axis_m += chain.joint(j).X_PJ.p.norm() + travel_m(chain.joint(j));
  for (const LinkShape& s : robot.shapes) {
    if (s.link != ball.link) continue;
    const geometry::Capsule c_E = lie::inverse(chain.X_NE()) * s.X_LS * geometry::enclosing_capsule(s.shape);
    ball.radius_m = std::max(ball.radius_m, std::max(c_E.p0.norm(), c_E.p1.norm()) + c_E.radius_m);
  }
  return ball;
}

double distance_m(const Vector3d& p_W, const geometry::Obstacle& o) {
  return geometry::closest({p_W, p_W, 0, 0}, o.shape, o.X_WO).distance_m;
}

/// No more than distance_m(); nor is that more than the distance of the obstacle's origin, which lies in it.
double distance_bound_m(const Vector3d& p_W, const geometry::Obstacle& o) {
  return geometry::distance_bound({p_W, p_W, 0, 0}, o.shape, o.X_WO);
}

}  // namespace

Eigen::MatrixXd levers(const Robot& robot) {
  const model::Chain& chain = robot.chain;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(chain.n(), chain.n());
  for (const LinkShape& s : robot.shapes) {
    if (s.link < 0) continue;
    const geometry::Capsule c = s.X_LS * geometry::enclosing_capsule(s.shape);
    double beyond = std::max(c.p0.norm(), c.p1.norm()) + c.radius_m;  // from joint j's origin
    for (int j = s.link; j >= 0; --j) {
      const model::Joint& joint = chain.joint(j);
      const bool slides = joint.kind == model::JointKind::prismatic;
      out(j, s.link) = std::max(out(j, s.link), slides ? 1.0 : beyond);
      beyond += joint.X_PJ.p.norm() + travel_m(joint);
    }
  }
  return out;
}

double Reach::inflation_m(const geometry::Obstacle& o) const noexcept {
  return 2 * std::max(o.sigma_m, 0.0) + accelerated_m_;
}

bool Reach::is_plain(const geometry::Obstacle& o) {
  return o.X_WO.p.allFinite() && o.X_WO.R.allFinite() && o.shape.dims_m.allFinite() &&
         (o.shape.dims_m.array() >= 0).all() && std::isfinite(o.sigma_m) && o.velocity_known &&
         o.V_WO.allFinite() && o.V_WO.head<3>().isZero(0);
}

double Reach::least_distance_m(const geometry::Obstacle& o, double horizon_s) const noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (const Centre& c : centres_) least = std::min(least, distance_m(c.p_W, o) - c.out_m);
  return least - spread_m(o, horizon_s) - kSlack_m;
}

Reach::Reach(const Robot& robot, const PlannerOptions& options)
    : target_(target_ball(robot, options)),
      chain_(robot.chain),
      ws_(chain_),
      lever_m_(levers(robot).rowwise().maxCoeff()),
      rho0_m_(options.rho0_m),
      margin_m_(options.barrier_gain > 0 ? options.dmin_m : 0),
      accelerated_m_(accelerated_m(options, options.stale_brake_s)) {
  for (const LinkShape& s : robot.shapes) {
    const geometry::Capsule c = s.X_LS * geometry::enclosing_capsule(s.shape);
    bodies_.push_back({part_of(s), geometry::solid(s.shape, s.X_LS)});
    add_ball(ball_of(chain_, part_of(s), c));
  }
}

void Reach::add_ball(const ReachBall& ball) {
  std::size_t k = 0;
  while (k < centres_.size() && centres_[k].p_W != ball.centre_W) ++k;
  if (k == centres_.size()) centres_.push_back({ball.centre_W});
  centres_[k].axis_m = std::max(centres_[k].axis_m, ball.axis_m);
  centres_[k].out_m = std::max(centres_[k].out_m, ball.axis_m + ball.radius_m);
  centre_of_.push_back(k);
  balls_.push_back(ball);
}

/// How much nearer an obstacle may be than where it was stamped: its way in the horizon.
double Reach::spread_m(const geometry::Obstacle& o, double horizon_s) const noexcept {
  const double v = o.V_WO.tail<3>().norm();
  return v > 0 ? v * horizon_s : 0;
}

/// `distance_m`: of the obstacle to the target's centre, at least.
bool Reach::may_cover_target(double distance_m, double way_m, double grown_m) const noexcept {
  const double least = distance_m - target_.axis_m - target_.radius_m - way_m;
  return !(least - grown_m > margin_m_);
}

bool Reach::stays_near(const Eigen::VectorXd& q) const noexcept {
  if (q.size() != q_near_.size()) return false;
  double way = 0;
  for (Eigen::Index j = 0; j < q.size(); ++j) way += lever_m_[j] * std::abs(q[j] - q_near_[j]);
  return way <= kNear_m;
}

void Reach::sift_near(const Eigen::VectorXd& q, std::span<const geometry::Obstacle> set,
                      std::vector<geometry::Obstacle>& kept) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  const auto stands = [](const geometry::Obstacle& o) { return is_plain(o) && o.V_WO.isZero(0); };
  q_near_ = q;
  rbd::positions(chain_, q, ws_);
  const std::size_t m = bodies_.size();
  near_m_.assign(set.size() * m, inf);
  nearest_m_.assign(slot(kLockedOn) + 1, inf);
  for (std::size_t b = 0; b < m; ++b) {
    if (bodies_[b].link == -1) continue;  // what stands cannot run into it
    const std::size_t link = slot(bodies_[b].link);
    const lie::Pose& X_WB = bodies_[b].link < 0 ? chain_.X_WB0() : ws_.X_WB[link];
    const geometry::Solid solid_W = X_WB * bodies_[b].solid_B;
    for (std::size_t k = 0; k < set.size(); ++k) {
      if (!stands(set[k])) continue;
      const geometry::Solid there = geometry::solid(set[k].shape, set[k].X_WO);
      double& near = near_m_[k * m + b];
      near = geometry::distance_bound(solid_W, there);
      const double grown = inflation_m(set[k]);
      if (near > std::max(rho0_m_ + grown, nearest_m_[link]) + 2 * kNear_m + kSlack_m) continue;
      near = geometry::closest(solid_W, there).distance_m;
      nearest_m_[link] = std::min(nearest_m_[link], near);
    }
  }
  kept.clear();
  for (std::size_t k = 0; k < set.size(); ++k) {
    const double grown = inflation_m(set[k]);
    bool matters = !stands(set[k]) || may_cover_target(distance_m(target_.centre_W, set[k]), kSlack_m, grown);
    for (std::size_t b = 0; b < m && !matters; ++b) {
      if (bodies_[b].link == -1) continue;
      const double most = std::max(rho0_m_ + grown, nearest_m_[slot(bodies_[b].link)]);
      matters = !(near_m_[k * m + b] > most + 2 * kNear_m + kSlack_m);
    }
    if (matters) kept.push_back(set[k]);
  }
}

/// By bounding spheres: puts into left_ what may matter for all they tell, and the others' floors into
/// floor_m.
void Reach::sift_roughly(std::span<const geometry::Obstacle> set, double horizon_s,
                         std::vector<double>& floor_m) {
  const std::size_t m = centres_.size();
  left_.clear();
  near_m_.resize(set.size() * m);
  nearest_m_.assign(m, std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < set.size(); ++k) {
    if (!is_plain(set[k])) continue;
    const double way = spread_m(set[k], horizon_s) + kSlack_m;
    for (std::size_t c = 0; c < m; ++c) {
      near_m_[k * m + c] = distance_bound_m(centres_[c].p_W, set[k]) - way;
      nearest_m_[c] = std::min(nearest_m_[c], (centres_[c].p_W - set[k].X_WO.p).norm() + way);
    }
  }
  for (std::size_t k = 0; k < set.size(); ++k) {
    const geometry::Obstacle& o = set[k];
    const double way = spread_m(o, horizon_s) + kSlack_m, grown = inflation_m(o);
    bool far = is_plain(o) && !may_cover_target(distance_bound_m(target_.centre_W, o), way, grown);
    for (std::size_t c = 0; c < m && far; ++c) {
      const double least = near_m_[k * m + c];
      far = least - grown > rho0_m_ + centres_[c].out_m &&
            least > nearest_m_[c] + centres_[c].axis_m + centres_[c].out_m;
    }
    if (!far) left_.push_back(k);
    for (std::size_t b = 0; b < balls_.size() && far; ++b) {
      double& floor = floor_m[slot(balls_[b].link)];
      const double least = near_m_[k * m + centre_of_[b]] - balls_[b].axis_m - balls_[b].radius_m;
      floor = std::min(floor, least - grown);
    }
  }
}

void Reach::sift(std::span<const geometry::Obstacle> set, double horizon_s,
                 std::vector<geometry::Obstacle>& kept, std::vector<double>& floor_m) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  const auto n = static_cast<std::size_t>(chain_.n());
  const std::size_t m = centres_.size();
  kept.clear();
  floor_m.assign(n + 2, inf);
  sift_roughly(set, horizon_s, floor_m);
  near_m_.resize(left_.size() * m);
  nearest_m_.assign(n + 2, inf);  // an upper bound of how far the obstacle nearest to each link is
  for (std::size_t k = 0; k < left_.size(); ++k) {
    const geometry::Obstacle& o = set[left_[k]];
    const bool plain = is_plain(o);
    const double way = spread_m(o, horizon_s) + kSlack_m, grown = inflation_m(o);
    for (std::size_t c = 0; c < m && plain; ++c) near_m_[k * m + c] = distance_m(centres_[c].p_W, o);
    for (std::size_t b = 0; b < balls_.size(); ++b) {
      const ReachBall& ball = balls_[b];
      const std::size_t link = slot(ball.link);
      const double s = plain ? near_m_[k * m + centre_of_[b]] - ball.radius_m : -inf;
      if (plain)
        nearest_m_[link] = std::min(nearest_m_[link], near_m_[k * m + centre_of_[b]] + ball.axis_m + way);
      floor_m[link] = std::min(floor_m[link], s - ball.axis_m - way - grown);
    }
  }
  nearest_m_[n] = -inf;  // of the base it does not matter
  floor_m.resize(n);
  for (std::size_t k = 0; k < left_.size(); ++k) {
    const geometry::Obstacle& o = set[left_[k]];
    const double way = spread_m(o, horizon_s) + kSlack_m, grown = inflation_m(o);
    bool matters = !is_plain(o) || may_cover_target(distance_m(target_.centre_W, o), way, grown);
    for (std::size_t b = 0; b < balls_.size() && !matters; ++b) {
      const ReachBall& ball = balls_[b];
      const double least = near_m_[k * m + centre_of_[b]] - ball.radius_m - ball.axis_m - way;
      matters = !(least - grown > rho0_m_ && least > nearest_m_[slot(ball.link)]);
    }
    if (matters) kept.push_back(o);
  }
}

}  // namespace hamel::scene
