#include "services/planner/core/pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "services/planner/core/mapping.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;

bool usable(const geometry::Obstacle& o) {
  const bool finite = o.X_WO.p.allFinite() && o.X_WO.R.allFinite() && o.shape.dims_m.allFinite() &&
                      (!o.velocity_known || o.V_WO.allFinite()) && std::isfinite(o.sigma_m);
  return finite && (o.shape.dims_m.array() >= 0).all();
}

void move(geometry::Obstacle& o, double age_s) {
  o.X_WO.p += age_s * o.V_WO.tail<3>();
  const Vector3d turn = age_s * o.V_WO.head<3>();
  const double angle = turn.norm();
  if (angle > 1e-12) o.X_WO.R = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * o.X_WO.R;
}

}  // namespace

Obstacles::Obstacles() { items_.reserve(kMost); }

void Obstacles::take(std::span<const geometry::Obstacle> stamped, double age_s,
                     const scene::PlannerOptions& o) noexcept {
  items_.clear();
  all_finite_ = true;
  too_many_ = stamped.size() > kMost;
  const double age = std::isfinite(age_s) ? std::max(age_s, 0.0) : 0.0;
  for (const geometry::Obstacle& s : stamped.first(std::min(stamped.size(), kMost))) {
    if (!usable(s)) {
      all_finite_ = false;
      continue;
    }
    Item item{s, 2 * std::max(s.sigma_m, 0.0), items_.size()};
    if (!s.velocity_known) {
      item.now.V_WO.setZero();
      item.inflation_m += o.assumed_speed_mps * age;
    }
    move(item.now, age);
    items_.push_back(item);
  }
  const auto before = [](const Item& a, const Item& b) {
    return std::tie(a.now.id, a.order) < std::tie(b.now.id, b.order);
  };
  if (!std::is_sorted(items_.begin(), items_.end(), before)) std::sort(items_.begin(), items_.end(), before);
}

Pairs::Pairs(const scene::Robot& robot, const scene::PlannerOptions& options)
    : options_(options),
      pairs_(kMaxPairs),
      nearest_(static_cast<std::size_t>(robot.chain.n())),
      n_(robot.chain.n()),
      J_(Eigen::MatrixXd::Zero(3, n_ * static_cast<Eigen::Index>(kMaxPairs))),
      MJ_(Eigen::MatrixXd::Zero(n_, 3)) {
  for (const scene::LinkShape& s : robot.shapes) {
    if (s.link < 0 || s.link >= robot.chain.n()) continue;  // the base does not move: nothing to steer
    bodies_.push_back({0, s.link, s.X_LS * geometry::enclosing_capsule(s.shape)});
    if (s.link == robot.chain.n() - 1) tip_radius_m_ = bodies_.back().capsule_B.radius_m;
  }
  std::stable_sort(bodies_.begin(), bodies_.end(),
                   [](const Body& a, const Body& b) { return a.link < b.link; });
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].index = static_cast<int>(i);
}

void Pairs::clear() noexcept {
  count_ = 0;
  dropped_ = 0;
  clearance_m_ = std::numeric_limits<double>::infinity();
  for (Nearest& n : nearest_) n = Nearest{};
}

geometry::Capsule Pairs::link_W(const Arm& arm, int shape) const noexcept {
  const Body& body = bodies_[static_cast<std::size_t>(shape)];
  return arm.ws.X_WB[static_cast<std::size_t>(body.link)] * body.capsule_B;
}

void Pairs::find(const Arm& arm, const Obstacles& obstacles, std::span<const double> link_floor_m) noexcept {
  clear();
  const auto floor_of = [&](const Body& body) {
    const auto link = static_cast<std::size_t>(body.link);
    return link < link_floor_m.size() ? link_floor_m[link] : -std::numeric_limits<double>::infinity();
  };
  for (const Body& body : bodies_)
    if (!(floor_of(body) > options_.rho0_m)) measure(body, arm, obstacles);
  for (const Body& body : bodies_)
    if (floor_of(body) > options_.rho0_m && floor_of(body) < clearance_m_) measure(body, arm, obstacles);
  if (dropped_ > 0)
    std::sort(
        pairs_.begin(), pairs_.begin() + static_cast<std::ptrdiff_t>(count_),
        [](const Pair& a, const Pair& b) { return std::tie(a.shape, a.item) < std::tie(b.shape, b.item); });
  const bool only_nearest =
      options_.method != scene::Method::gyro && options_.pairs == scene::PairPolicy::nearest;
  if (only_nearest) keep_nearest_of_each_link();
}

void Pairs::measure(const Body& body, const Arm& arm, const Obstacles& obstacles) noexcept {
  const geometry::Capsule capsule = link_W(arm, body.index);
  Nearest& nearest = nearest_[static_cast<std::size_t>(body.link)];
  for (const Obstacles::Item& item : obstacles.items()) {
    const double bound = geometry::distance_bound(capsule, item.now.shape, item.now.X_WO);
    if (bound - item.inflation_m > options_.rho0_m && bound > nearest.at.distance_m) continue;
    Pair pair;
    pair.at = geometry::closest(capsule, item.now.shape, item.now.X_WO);
    if (pair.at.distance_m < nearest.at.distance_m) nearest = {&item, body.index, pair.at};
    pair.d = pair.at.distance_m - item.inflation_m;
    if (!(pair.d <= options_.rho0_m)) continue;
    pair.shape = body.index;
    pair.link = body.link;
    pair.obstacle = item.now.id;
    pair.item = &item;
    pair.n = pair.at.normal;
    offer(pair);
  }
  clearance_m_ = std::min(clearance_m_, nearest.at.distance_m);
}

// When the table is full the farthest pair makes room.
void Pairs::offer(const Pair& pair) noexcept {
  if (count_ < pairs_.size()) {
    pairs_[count_++] = pair;
    return;
  }
  ++dropped_;
  auto farthest =
      std::max_element(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) { return a.d < b.d; });
  if (pair.d < farthest->d) *farthest = pair;
}

void Pairs::keep_nearest_of_each_link() noexcept {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    const bool same_link = kept > 0 && pairs_[kept - 1].link == pairs_[k].link;
    if (!same_link)
      pairs_[kept++] = pairs_[k];
    else if (pairs_[k].d < pairs_[kept - 1].d)
      pairs_[kept - 1] = pairs_[k];
  }
  count_ = kept;
}

void Pairs::advance(const Arm& arm, double ahead_s) noexcept {
  for (Pair& pair : items()) {
    lie::Pose X_WO = pair.item->now.X_WO;
    X_WO.p += ahead_s * pair.item->now.V_WO.tail<3>();
    pair.at = geometry::closest(link_W(arm, pair.shape), pair.item->now.shape, X_WO);
    pair.d = pair.at.distance_m - pair.item->inflation_m;
    pair.n = pair.at.normal;
  }
}

void Pairs::complete(const Arm& arm) noexcept {
  for (std::size_t k = 0; k < count_; ++k) {
    Pair& pair = pairs_[k];
    auto J_k = J(k);
    rbd::point_jacobian(arm.chain, arm.ws, pair.link, pair.at.on_link, J_k);
    const geometry::Obstacle& o = pair.item->now;
    pair.v.noalias() = J_k * arm.qd;
    pair.v_obstacle = o.V_WO.tail<3>() + o.V_WO.head<3>().cross(pair.at.on_obstacle - o.X_WO.p);
    pair.v_relative = pair.v - pair.v_obstacle;
    MJ_.noalias() = arm.M_inverse.lazyProduct(J_k.transpose());
    const Eigen::Matrix3d B = J_k.lazyProduct(MJ_);
    pair.Lam = operational_inertia(options_, B);
  }
}

}  // namespace hamel::planner
