#include "services/planner/core/obstacles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace hamel::planner {
namespace {

using Eigen::Vector3d;

constexpr double kFastest_mps = 10;  // of an obstacle that does not say; a faster jump is a wrong sample

bool usable(const geometry::Obstacle& o) {
  const bool finite = o.X_WO.p.allFinite() && o.X_WO.R.allFinite() && o.shape.dims_m.allFinite() &&
                      (!o.velocity_known || o.V_WO.allFinite()) && std::isfinite(o.sigma_m);
  return finite && (o.shape.dims_m.array() >= 0).all();
}

constexpr double kForget_s = 1;  // a gap after which an obstacle counts as new

// The table's entry of an obstacle, a new one, or null where the table is full of fresher ones.
Sighting* sighting(Memory& m, std::uint32_t id, double stamp_s) {
  const auto end = m.sightings.begin() + static_cast<std::ptrdiff_t>(m.sighting_count);
  const auto it = std::find_if(m.sightings.begin(), end, [&](const Sighting& s) { return s.obstacle == id; });
  if (it != end) return &*it;
  Sighting* free = nullptr;
  if (m.sighting_count < m.sightings.size())
    free = &m.sightings[m.sighting_count++];
  else
    for (Sighting& s : m.sightings)
      if (std::abs(stamp_s - s.stamp_s) > kForget_s) free = &s;
  if (free) *free = Sighting{id, stamp_s, {}, {}, Known::nothing};
  return free;
}

// The velocity of an obstacle that does not tell it; false: not known yet.
bool estimate(Memory& m, const geometry::Obstacle& o, double stamp_s, Vector3d& velocity) {
  Sighting* s = sighting(m, o.id, stamp_s);
  if (!s) return false;
  const double passed_s = stamp_s - s->stamp_s;
  const Vector3d at(s->at[0], s->at[1], s->at[2]), before(s->velocity[0], s->velocity[1], s->velocity[2]);
  const bool seen = s->known != Known::nothing, had_velocity = s->known == Known::velocity;
  if (seen && std::abs(passed_s) < 1e-9) {
    velocity = before;
    return had_velocity;
  }
  const Vector3d now = (o.X_WO.p - at) / passed_s;
  const bool trusted = seen && passed_s > 0 && passed_s < kForget_s && now.norm() < kFastest_mps;
  velocity = trusted ? had_velocity ? Vector3d(0.5 * (before + now)) : now : Vector3d::Zero();
  *s = Sighting{o.id,
                stamp_s,
                {o.X_WO.p[0], o.X_WO.p[1], o.X_WO.p[2]},
                {velocity[0], velocity[1], velocity[2]},
                trusted ? Known::velocity : Known::place};
  return trusted;
}

}  // namespace

Workspace workspace(const scene::Robot& robot) {
  const model::Chain& chain = robot.chain;
  Workspace out{chain.X_WB0() * chain.joint(0).X_PJ.p, 0};
  for (const scene::LinkShape& s : robot.shapes)
    if (s.link < 0)
      out.radius_m = std::max(out.radius_m, (chain.X_WB0() * s.X_LS.p - out.centre_W).norm() +
                                                geometry::solid(s.shape, {}).bound_m);
  double reach = 0;  // of a link's frame
  for (int i = 0; i < chain.n(); ++i) {
    const model::Joint& joint = chain.joint(i);
    if (i > 0) reach += joint.X_PJ.p.norm();
    reach += travel_m(joint);
    out.radius_m = std::max(out.radius_m, reach);
    for (const scene::LinkShape& s : robot.shapes)
      if (s.link == i)
        out.radius_m = std::max(out.radius_m, reach + s.X_LS.p.norm() + geometry::solid(s.shape, {}).bound_m);
  }
  return out;
}

Obstacles::Obstacles(const Workspace& workspace) : workspace_(workspace) {
  items_.reserve(kMost);
  near_.reserve(kMost);
}

bool in_reach(const Workspace& workspace, const geometry::Obstacle& o,
              const scene::PlannerOptions& options) noexcept {
  geometry::Solid sphere;  // the workspace
  sphere.X.p = workspace.centre_W;
  sphere.bound_m = workspace.radius_m;
  const double distance = geometry::distance_bound(sphere, geometry::solid(o.shape, o.X_WO));
  const double speed = o.velocity_known ? o.V_WO.tail<3>().norm() : kFastest_mps;
  const double most_s = options.stale_brake_s;
  const double felt =
      options.rho0_m + 2 * std::max(o.sigma_m, 0.0) + speed * most_s + accelerated_m(options, most_s);
  return !(distance > std::max(felt, kSeen_m));
}

// Which of a new set matter, in order of their ids.
void Obstacles::sift(std::span<const geometry::Obstacle> stamped, const scene::PlannerOptions& o) noexcept {
  near_.clear();
  all_finite_ = true;
  too_many_ = stamped.size() > kMost;
  const std::size_t count = std::min(stamped.size(), kMost);
  for (std::size_t k = 0; k < count; ++k) {
    if (!usable(stamped[k]))
      all_finite_ = false;
    else if (in_reach(workspace_, stamped[k], o))
      near_.push_back(k);
  }
  const auto before = [&](std::size_t a, std::size_t b) {
    return std::tie(stamped[a].id, a) < std::tie(stamped[b].id, b);
  };
  if (!std::is_sorted(near_.begin(), near_.end(), before)) std::sort(near_.begin(), near_.end(), before);
}

void Obstacles::take(std::span<const geometry::Obstacle> stamped, double t_s, double age_s,
                     const scene::PlannerOptions& o, Memory& memory, std::uint64_t set) noexcept {
  const bool known = set != 0 && set == set_ && stamped.size() == set_size_;
  if (!known) sift(stamped, o);
  set_ = set;
  set_size_ = stamped.size();
  items_.clear();
  estimated_ = unknown_ = 0;
  fastest_mps_ = 0;
  const double age = std::isfinite(age_s) ? std::max(age_s, 0.0) : 0.0;
  age_s_ = age;
  for (const std::size_t k : near_) {
    const geometry::Obstacle& s = stamped[k];
    Item item{s, {}, 2 * std::max(s.sigma_m, 0.0) + accelerated_m(o, age), k};
    if (!s.velocity_known) {
      item.now.V_WO.setZero();
      Vector3d velocity;
      if (estimate(memory, s, std::isfinite(s.seen_s) ? s.seen_s : t_s - age, velocity)) {
        item.now.V_WO.tail<3>() = velocity;
        ++estimated_;
      } else {
        item.inflation_m += o.assumed_speed_mps * age;
        ++unknown_;
      }
    }
    const double grows = (s.velocity_known ? 0 : o.assumed_speed_mps) + o.assumed_acceleration_mps2 * age;
    const double speed = item.now.V_WO.tail<3>().norm() + grows;
    fastest_mps_ = item.now.V_WO.head<3>().isZero(0) ? std::max(fastest_mps_, speed) : scene::kInf;
    item.now.X_WO = lie::moved(item.now.X_WO, item.now.V_WO, age);
    item.solid = geometry::solid(item.now.shape, item.now.X_WO);
    items_.push_back(item);
  }
}

}  // namespace hamel::planner
