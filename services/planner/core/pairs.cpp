#include "services/planner/core/pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "common/scene/reach.h"
#include "services/planner/core/mapping.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;

bool leaves_less(const Obstacles::Item& item, const geometry::Solid& solid_W, double margin_m) noexcept {
  return geometry::distance_bound(solid_W, item.solid) < margin_m &&
         geometry::closest(solid_W, item.solid).distance_m < margin_m;
}

constexpr double kOwnWay_m = 0.05;  // what list_near_links() found is good for so far a way of the links

}  // namespace

Pairs::Pairs(const scene::Robot& robot, const scene::PlannerOptions& options, const Savings& savings)
    : options_(options),
      savings_(savings),
      levers_m_(scene::levers(robot)),
      asked_(static_cast<std::size_t>(robot.chain.n())),
      rests_(asked_.size(), false),
      pairs_(kMost),
      nearest_(static_cast<std::size_t>(robot.chain.n())),
      n_(robot.chain.n()),
      J_(Eigen::MatrixXd::Zero(3, n_ * static_cast<Eigen::Index>(kMost))),
      MJ_(Eigen::MatrixXd::Zero(n_, 3)),
      J_other_(Eigen::MatrixXd::Zero(3, n_)) {
  for (std::size_t k = 0; k < robot.shapes.size(); ++k) {
    const scene::LinkShape& s = robot.shapes[k];
    if (s.link < -1 || s.link >= robot.chain.n()) continue;
    bodies_.push_back({k, 0, s.link, geometry::solid(s.shape, s.X_LS), {}, s.was_link});
    if (s.link != robot.chain.n() - 1) continue;
    tip_E_.push_back(geometry::solid(s.shape, lie::inverse(robot.chain.X_NE()) * s.X_LS));
    const geometry::Solid tip = geometry::solid({}, {});  // a point
    tip_radius_m_ = std::max(tip_radius_m_, -geometry::closest(tip, tip_E_.back()).distance_m);
  }
  std::stable_sort(bodies_.begin(), bodies_.end(),
                   [](const Body& a, const Body& b) { return a.link < b.link; });
  for (Body& b : bodies_)
    if (b.link >= 0) b.index = shapes_++;
  for (std::size_t b = 0; b < bodies_.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) {
      const std::pair both{bodies_[a].of_robot, bodies_[b].of_robot};
      if (std::count(robot.self_pairs.begin(), robot.self_pairs.end(), both) > 0) own_.push_back({a, b});
    }
  near_own_.reserve(own_.size());
  lever_m_ = levers_m_.rowwise().maxCoeff();
  q_own_ = Eigen::VectorXd::Constant(n_, std::numeric_limits<double>::quiet_NaN());  // near nothing
  for (Asked& a : asked_) a.q = q_own_;
  links_.resize(bodies_.size());
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    links_[k].now.shape = bodies_[k].solid_B.shape;
    links_[k].solid = bodies_[k].solid_B;
  }
}

void Pairs::clear() noexcept {
  count_ = self_count_ = 0;
  dropped_ = 0;
  base_touched_ = false;
  clearance_m_ = self_clearance_m_ = std::numeric_limits<double>::infinity();
  for (Nearest& n : nearest_) n = Nearest{};
}

const geometry::Solid& Pairs::place(const Arm& arm, Body& b) noexcept {
  if (b.placed != placing_) {
    const lie::Pose& X_WB = b.link < 0 ? arm.chain.X_WB0() : arm.ws.X_WB[static_cast<std::size_t>(b.link)];
    b.solid_W = X_WB * b.solid_B;
    b.placed = placing_;
  }
  return b.solid_W;
}

// True while the link, and what moves, cannot have gone farther than its distances may be off, nor into
// range.
bool Pairs::rests(const Arm& arm, const Obstacles& obstacles, std::size_t link) const noexcept {
  const Asked& a = asked_[link];
  if (!(a.spare_m > 0) || !a.nearest.item) return false;
  double way = obstacles.fastest_mps() * std::abs(obstacles.age_s() - a.age_s);
  for (Eigen::Index j = 0; j <= static_cast<Eigen::Index>(link); ++j)
    way += levers_m_(j, static_cast<Eigen::Index>(link)) * std::abs(arm.q[j] - a.q[j]);
  return way < std::min(savings_.requery_m, a.spare_m);
}

void Pairs::find(const Arm& arm, const Obstacles& obstacles, std::span<const double> link_floor_m) noexcept {
  const bool same_set = obstacles.set() != 0 && obstacles.set() == asked_set_;
  const bool may_rest = savings_.requery_m > 0 && same_set && slides_hold(arm.chain, arm.q);
  asked_set_ = obstacles.set();
  for (std::size_t link = 0; link < rests_.size(); ++link) {
    rests_[link] = may_rest && rests(arm, obstacles, link);
    if (rests_[link]) continue;
    asked_[link].q = arm.q;
    asked_[link].age_s = obstacles.age_s();
    asked_[link].spare_m = std::numeric_limits<double>::infinity();
  }
  clear();
  for (std::size_t link = 0; link < rests_.size(); ++link)
    if (rests_[link]) nearest_[link] = asked_[link].nearest;
  ++placing_;
  const auto floor_of = [&](const Body& body) {
    const auto link = static_cast<std::size_t>(body.link);
    return link < link_floor_m.size() ? link_floor_m[link] : -std::numeric_limits<double>::infinity();
  };
  const auto is_far = [&](const Body& body) { return body.link >= 0 && floor_of(body) > options_.rho0_m; };
  for (Body& body : bodies_) {
    if (body.link < 0)
      touch_base(arm, body, obstacles);
    else if (rests_[static_cast<std::size_t>(body.link)])
      clearance_m_ = std::min(clearance_m_, nearest_[static_cast<std::size_t>(body.link)].at.distance_m);
    else if (!is_far(body))
      measure(arm, body, obstacles);
  }
  for (Body& body : bodies_)
    if (is_far(body) && !rests_[static_cast<std::size_t>(body.link)] && floor_of(body) < clearance_m_)
      measure(arm, body, obstacles);
  if (savings_.requery_m > 0)
    for (std::size_t link = 0; link < rests_.size(); ++link) asked_[link].nearest = nearest_[link];
  if (dropped_ > 0)
    std::sort(
        pairs_.begin(), pairs_.begin() + static_cast<std::ptrdiff_t>(count_),
        [](const Pair& a, const Pair& b) { return std::tie(a.shape, a.item) < std::tie(b.shape, b.item); });
  const bool only_nearest =
      options_.method != scene::Method::gyro && options_.pairs == scene::PairPolicy::nearest;
  if (only_nearest) keep_nearest_of_each_link();
  find_self(arm);
}

// The base does not move: there is nothing to steer, but who runs into it has touched the arm.  What stands
// touches it by design, but not a link locked onto it, whose clearance counts like that of any other.
void Pairs::touch_base(const Arm& arm, Body& body, const Obstacles& obstacles) noexcept {
  const geometry::Solid& base_W = place(arm, body);
  for (const Obstacles::Item& item : obstacles.items()) {
    const bool stands = item.now.velocity_known && item.now.V_WO.isZero(0);
    const double least = body.was_link ? clearance_m_ : std::min(clearance_m_, 0.0);
    if ((stands && !body.was_link) || geometry::distance_bound(base_W, item.solid) > least) continue;
    const double d = geometry::closest(base_W, item.solid).distance_m;
    clearance_m_ = d < least ? d : clearance_m_;
    base_touched_ = base_touched_ || d < 0;
  }
}

// Pairs of two links that may come into range while no link goes farther than kOwnWay_m against another: one
// moves against the other by no more than the joints between them carry it.
void Pairs::list_near_links(const Arm& arm) noexcept {
  near_own_.clear();
  q_own_ = arm.q;
  const double range = std::min(options_.rho0_m, kSelfRange_m) + kOwnWay_m;
  for (const Own& own : own_) {
    const geometry::Solid &a = place(arm, bodies_[own.a]), &b = place(arm, bodies_[own.b]);
    if (!(geometry::distance_bound(b, a) > range)) near_own_.push_back(own);
  }
}

// Pairs of two links: the one nearer to the base stands for the obstacle, with the twist it has.
void Pairs::find_self(const Arm& arm) noexcept {
  const double range = std::min(options_.rho0_m, kSelfRange_m);
  if (savings_.far_links) {
    const double way = lever_m_.dot((arm.q - q_own_).cwiseAbs());
    if (!(way < kOwnWay_m) || !slides_hold(arm.chain, arm.q)) list_near_links(arm);
  }
  for (const Own& own : savings_.far_links ? near_own_ : own_) {
    Body &a = bodies_[own.a], &b = bodies_[own.b];
    if (geometry::distance_bound(place(arm, b), place(arm, a)) > range) continue;
    Pair pair;
    pair.at = geometry::closest(b.solid_W, a.solid_W);
    pair.d = pair.at.distance_m;
    self_clearance_m_ = std::min(self_clearance_m_, pair.d);
    if (!(pair.d <= range)) continue;
    Obstacles::Item& item = links_[own.a];
    item.now.X_WO = a.solid_W.X;
    item.now.V_WO.setZero();
    if (a.link >= 0) {
      const auto i = static_cast<std::size_t>(a.link);
      item.now.V_WO.head<3>() = arm.angular_velocity(a.link);
      item.now.V_WO.tail<3>() = arm.ws.X_WB[i].R * arm.ws.V_B[i].tail<3>() +
                                item.now.V_WO.head<3>().cross(a.solid_W.X.p - arm.ws.X_WB[i].p);
    }
    pair.shape = b.index;
    pair.link = b.link;
    pair.span_m = 2 * b.solid_B.bound_m;
    pair.other_link = a.link;
    pair.item = &item;
    pair.n = pair.at.normal;
    std::size_t slot = count_ + self_count_;
    if (self_count_ == kMaxSelf) {
      for (std::size_t k = count_; k < count_ + kMaxSelf; ++k)
        if (slot == count_ + kMaxSelf || pairs_[k].d > pairs_[slot].d) slot = k;
      if (!(pair.d < pairs_[slot].d)) continue;
    } else {
      ++self_count_;
    }
    pairs_[slot] = pair;
  }
}

void Pairs::measure(const Arm& arm, Body& body, const Obstacles& obstacles) noexcept {
  Nearest& nearest = nearest_[static_cast<std::size_t>(body.link)];
  double& spare = asked_[static_cast<std::size_t>(body.link)].spare_m;
  const geometry::Solid& solid_W = place(arm, body);
  for (const Obstacles::Item& item : obstacles.items()) {
    const double bound = geometry::distance_bound(solid_W, item.solid), far = bound - item.inflation_m;
    if (far > options_.rho0_m && bound > nearest.at.distance_m) {
      spare = std::min(spare, far - options_.rho0_m);
      continue;
    }
    Pair pair;
    pair.at = geometry::closest(solid_W, item.solid);
    spare = std::min(spare, pair.at.distance_m - item.inflation_m - options_.rho0_m);
    if (pair.at.distance_m < nearest.at.distance_m) nearest = {&item, body.index, pair.at};
    pair.d = pair.at.distance_m - item.inflation_m;
    if (!(pair.d <= options_.rho0_m)) continue;
    pair.shape = body.index;
    pair.link = body.link;
    pair.obstacle = item.now.id;
    pair.span_m = 2 * body.solid_B.bound_m;
    pair.item = &item;
    pair.n = pair.at.normal;
    offer(pair);
  }
  clearance_m_ = std::min(clearance_m_, nearest.at.distance_m);
}

bool Pairs::blocks(const Obstacles::Item& item, const lie::Pose& X_WE, bool turns,
                   double margin_m) const noexcept {
  if (turns)
    return leaves_less(item, geometry::solid({geometry::ShapeKind::sphere, {tip_radius_m_, 0, 0}}, X_WE),
                       margin_m);
  return std::any_of(tip_E_.begin(), tip_E_.end(),
                     [&](const auto& s_E) { return leaves_less(item, X_WE * s_E, margin_m); });
}

void Pairs::set_goal(const model::Chain& chain, const Eigen::VectorXd& q) {
  rbd::Workspace ws(chain);
  rbd::positions(chain, q, ws);
  at_goal_.clear();
  for (const Body& b : bodies_) {
    if (b.link < 0) continue;
    const double turns_m = levers_m_.col(b.link).head(b.link + 1).sum();
    at_goal_.push_back(
        {ws.X_WB[static_cast<std::size_t>(b.link)] * b.solid_B, options_.goal_tolerance_joint * turns_m});
  }
}

bool Pairs::blocks_goal(const Obstacles::Item& item, double margin_m, bool anywhere) const noexcept {
  return std::any_of(at_goal_.begin(), at_goal_.end(), [&](const AtGoal& b) {
    return leaves_less(item, b.solid_W, anywhere ? margin_m - b.slack_m : margin_m);
  });
}

// When the table is full the farthest pair makes room.
void Pairs::offer(const Pair& pair) noexcept {
  if (count_ < kMaxPairs) {
    pairs_[count_++] = pair;
    return;
  }
  ++dropped_;
  auto farthest = std::max_element(pairs_.begin(), pairs_.begin() + static_cast<std::ptrdiff_t>(count_),
                                   [](const Pair& a, const Pair& b) { return a.d < b.d; });
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
  ++placing_;
  const auto body = [&](int shape) -> Body& {
    return bodies_[bodies_.size() - static_cast<std::size_t>(shapes_ - shape)];
  };
  for (Pair& pair : items()) {
    const geometry::Obstacle& o = pair.item->now;
    const geometry::Solid there = geometry::solid(o.shape, lie::moved(o.X_WO, o.V_WO, ahead_s));
    pair.at = geometry::closest(place(arm, body(pair.shape)), there);
    pair.d = pair.at.distance_m - pair.item->inflation_m;
    pair.n = pair.at.normal;
  }
  if (!own_.empty()) {
    const double clearance = self_clearance_m_;
    self_count_ = 0;
    find_self(arm);
    self_clearance_m_ = clearance;  // of now
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
    pair.B = J_k.lazyProduct(MJ_);
    pair.Lam = operational_inertia(options_, pair.B);
  }
  for (std::size_t k = count_; k < count_ + self_count_; ++k) complete_self(arm, k);
}

void Pairs::complete_self(const Arm& arm, std::size_t k) noexcept {
  Pair& pair = pairs_[k];
  auto J_k = J(k);
  rbd::point_jacobian(arm.chain, arm.ws, pair.link, pair.at.on_link, J_k);
  pair.v.noalias() = J_k * arm.qd;
  pair.v_obstacle.setZero();
  if (pair.other_link >= 0) {
    rbd::point_jacobian(arm.chain, arm.ws, pair.other_link, pair.at.on_obstacle, J_other_);
    pair.v_obstacle.noalias() = J_other_ * arm.qd;
    J_k -= J_other_;
  }
  pair.v_relative = pair.v - pair.v_obstacle;
}

Vector3d Pairs::bias(const Arm& arm, const Pair& pair) const noexcept {
  const auto bias_of = [&arm](int link, const Vector3d& p_W) {
    return rbd::point_bias_acceleration(arm.ws, link, p_W, arm.Vdot_B[static_cast<std::size_t>(link)]);
  };
  Vector3d a = bias_of(pair.link, pair.at.on_axis);
  const bool flat = !std::isfinite(pair.at.centre_m);
  const Vector3d there = flat ? pair.at.on_obstacle : Vector3d(pair.at.on_axis + pair.at.centre_m * pair.n);
  if (pair.other_link >= 0) a -= bias_of(pair.other_link, there);
  return a;
}

}  // namespace hamel::planner
