#include "common/scene/outward.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "common/geometry/hull.h"

namespace hamel::scene {
namespace {

using geometry::Capsule;
using geometry::ShapeKind;

bool is_round(const geometry::Shape& s) {
  return s.kind == ShapeKind::sphere || s.kind == ShapeKind::capsule;
}

/// A capsule, or sphere, as a shape at a pose of the capsule's frame.
void to_shape(const Capsule& c, geometry::Shape& shape, lie::Pose& X) {
  const Eigen::Vector3d along = c.p1 - c.p0;
  const double length = along.norm();
  shape = {length > 0 ? ShapeKind::capsule : ShapeKind::sphere, {c.radius_m, length, 0}};
  X.p = 0.5 * (c.p0 + c.p1);
  X.R.setIdentity();
  if (length > 0)
    X.R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along).toRotationMatrix();
}

/// Hulls of the groups: for each first member its capsule.
std::vector<Capsule> hulls(const std::vector<Capsule>& members, const std::vector<std::size_t>& first_of) {
  std::vector<Capsule> out = members, chain;
  for (std::size_t i = 0; i < members.size(); ++i) {
    chain.clear();
    for (std::size_t j = i; j < members.size(); ++j)
      if (first_of[j] == i) chain.push_back(members[j]);
    if (chain.size() > 1) out[i] = geometry::hull(chain);
  }
  return out;
}

/// A shape of a robot among those that may be put together.
struct Candidate {
  std::size_t shape = 0;
  Capsule capsule;
};

std::vector<Candidate> candidates(const Robot& robot, int link, double most_m) {
  std::vector<Candidate> out;
  for (std::size_t k = 0; k < robot.shapes.size(); ++k) {
    const LinkShape& s = robot.shapes[k];
    if (part_of(s) != link || s.shape.kind == ShapeKind::half_space) continue;
    const Capsule c = s.X_LS * geometry::tight_capsule(s.shape);
    if (c.excess_m <= most_m) out.push_back({k, c});
  }
  return out;
}

/// For each shape those it is watched against.  Shapes that locked joints brought onto one link differ in it:
/// neighbours of what one of them is watched against would be found touching as part of the other.
std::vector<std::vector<std::size_t>> watched_against(const Robot& robot) {
  std::vector<std::vector<std::size_t>> out(robot.shapes.size());
  for (const auto& [a, b] : robot.self_pairs) out[a].push_back(b), out[b].push_back(a);
  for (std::vector<std::size_t>& others : out) std::sort(others.begin(), others.end());
  return out;
}

/// Puts those together that may be; says for each which it became part of, and by how much they grew.
double put_together(Robot& robot, const std::vector<Candidate>& all, double most_m,
                    std::vector<std::size_t>& stands_for) {
  double excess = 0;
  std::vector<Capsule> members;
  for (const Candidate& c : all) members.push_back(c.capsule);
  const std::vector<double> room(members.size(), most_m);
  const std::vector<std::size_t> first_of = geometry::group(members, room);
  const std::vector<Capsule> grown = hulls(members, first_of);
  for (std::size_t i = 0; i < all.size(); ++i) {
    stands_for[all[i].shape] = all[first_of[i]].shape;
    LinkShape& s = robot.shapes[all[i].shape];
    const bool same = is_round(s.shape) && std::count(first_of.begin(), first_of.end(), i) == 1;
    if (first_of[i] != i || same) continue;
    to_shape(grown[i], s.shape, s.X_LS);
    excess = std::max(excess, grown[i].excess_m);
  }
  return excess;
}

}  // namespace

double simplify_shapes(Robot& robot, double most_m) {
  double excess = 0;
  const std::size_t count = robot.shapes.size();
  std::vector<std::size_t> stands_for(count);  // the shape that a shape became part of
  for (std::size_t k = 0; k < count; ++k) stands_for[k] = k;
  const std::vector<std::vector<std::size_t>> watched = watched_against(robot);
  for (int link = kLockedOn; link < robot.chain.n(); ++link) {
    std::vector<Candidate> rest = candidates(robot, link, most_m);
    while (!rest.empty()) {
      const std::size_t first = rest.front().shape;
      const auto end = std::stable_partition(
          rest.begin(), rest.end(), [&](const Candidate& c) { return watched[c.shape] == watched[first]; });
      const std::vector<Candidate> alike(rest.begin(), end);
      rest.erase(rest.begin(), end);
      excess = std::max(excess, put_together(robot, alike, most_m, stands_for));
    }
  }
  std::vector<std::size_t> place(count);
  std::vector<LinkShape> kept;
  for (std::size_t k = 0; k < count; ++k) {
    if (stands_for[k] != k) continue;
    place[k] = kept.size();
    kept.push_back(robot.shapes[k]);
  }
  for (auto& [a, b] : robot.self_pairs) a = place[stands_for[a]], b = place[stands_for[b]];
  std::sort(robot.self_pairs.begin(), robot.self_pairs.end());
  robot.self_pairs.erase(std::unique(robot.self_pairs.begin(), robot.self_pairs.end()),
                         robot.self_pairs.end());
  robot.shapes = std::move(kept);
  return excess;
}

void Merge::apply(const Reach& reach, double horizon_s, std::vector<geometry::Obstacle>& set) {
  excess_m_ = 0;
  std::vector<bool> done(set.size(), false), gone(set.size(), false);
  std::vector<std::size_t> alike;
  std::vector<Capsule> members;
  std::vector<double> room;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (done[i]) continue;
    alike.clear(), members.clear(), room.clear();
    for (std::size_t j = i; j < set.size(); ++j) {
      const geometry::Obstacle &a = set[i], &b = set[j];
      const bool same = Reach::is_plain(b) && is_round(b.shape) && a.V_WO == b.V_WO && a.sigma_m == b.sigma_m;
      if (done[j] || !same) continue;
      done[j] = true;
      alike.push_back(j);
      members.push_back(b.X_WO * geometry::enclosing_capsule(b.shape));
      room.push_back(most_m_ * std::max(1.0, reach.least_distance_m(b, horizon_s) / rho0_m_));
    }
    if (alike.size() < 2) continue;
    const std::vector<std::size_t> first_of = geometry::group(members, room);
    const std::vector<Capsule> grown = hulls(members, first_of);
    for (std::size_t k = 0; k < alike.size(); ++k) {
      geometry::Obstacle& first = set[alike[first_of[k]]];
      if (first_of[k] != k) {
        first.id = std::min(first.id, set[alike[k]].id);
        gone[alike[k]] = true;
      } else if (std::count(first_of.begin(), first_of.end(), k) > 1) {
        to_shape(grown[k], first.shape, first.X_WO);
        excess_m_ = std::max(excess_m_, grown[k].excess_m);
      }
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < set.size(); ++i)
    if (!gone[i]) set[kept++] = set[i];
  set.resize(kept);
}

}  // namespace hamel::scene
