#include "clients/hamel/judge.h"

#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>
#include <utility>

#include "clients/hamel/fcl_shapes.h"
#include "common/rbd/rbd.h"

namespace hamel::client {

namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using geometry::Obstacle;
using geometry::ShapeKind;
using Solid = FclSolid;

constexpr double kFinest_m = 1e-3;        // travel between two samples, at most
constexpr double kCausing_mps = 0.02;     // of the arm's point toward what it touches
constexpr double kCausingWithin_s = 0.1;  // before the touch
constexpr double kInf = std::numeric_limits<double>::infinity();

/// Farthest point of a shape from its origin.
double extent(const geometry::Shape& s) {
  const Vector3d& d = s.dims_m;
  switch (s.kind) {
    case ShapeKind::sphere:
      return d[0];
    case ShapeKind::capsule:
      return d[0] + 0.5 * d[1];
    case ShapeKind::cylinder:
      return std::hypot(d[0], 0.5 * d[1]);
    case ShapeKind::box:
      return 0.5 * d.norm();
    case ShapeKind::half_space:
      break;
  }
  return kHalfSpace_m;
}

double distance(const Solid& a, const Isometry3d& X_a, const Solid& b, const Isometry3d& X_b) {
  const fcl::DistanceRequestd request;
  fcl::DistanceResultd result;
  return fcl::distance(a.get(), X_a, b.get(), X_b, request, result);
}

}  // namespace

struct Judge::Impl {
  /// A solid of the arm.
  struct Body {
    int link = -1;
    Solid solid;
    Isometry3d X_LS = Isometry3d::Identity();
    Isometry3d X_WS = Isometry3d::Identity();
  };
  /// An obstacle as it goes from one state to the next.
  struct Other {
    Obstacle then, now;
    Solid solid;
    double size_m = 0;  // farthest point from its origin
    double travel_m = 0;
    bool fresh = true;            // not yet looked at
    bool unheard = true;          // nor ever before
    std::vector<double> due_m{};  // for each body: look again when the two have travelled so far together
  };
  struct SelfPair {
    int a = 0, b = 0;
    double due_m = 0;
  };

  explicit Impl(const scene::Robot& r)
      : chain(r.chain), ws(chain), travel_m(static_cast<std::size_t>(chain.n()), 0.0) {
    for (const scene::LinkShape& s : r.shapes) {
      bodies.push_back({s.link, fcl_solid(s.shape), fcl_transform(s.shape, s.X_LS)});
      size_m.push_back(s.X_LS.p.norm() + extent(s.shape));
    }
    for (const auto& [a, b] : r.self_pairs)
      self_pairs.push_back({static_cast<int>(a), static_cast<int>(b), 0});
    set_levers();
  }

  // How far the farthest point of link i's shapes is from joint j, at most.
  void set_levers() {
    const int n = chain.n();
    levers.setZero(n, n);
    for (int i = 0; i < n; ++i) {
      double reach = 0;
      for (std::size_t k = 0; k < bodies.size(); ++k)
        if (bodies[k].link == i) reach = std::max(reach, size_m[k]);
      for (int j = i; j >= 0; --j) {
        const model::Joint& joint = chain.joint(j);
        const bool slides = joint.kind == model::JointKind::prismatic;
        levers(i, j) = slides ? 1 : reach;
        const double longest = model::travel_m(joint);
        reach += joint.X_PJ.p.norm() + (std::isfinite(longest) ? longest : 0);
      }
    }
  }

  double travel(int link) const { return link < 0 ? 0 : travel_m[static_cast<std::size_t>(link)]; }

  void place(const Eigen::VectorXd& q) {
    rbd::positions(chain, q, ws);
    for (Body& b : bodies) {
      const lie::Pose& X_WL = b.link < 0 ? chain.X_WB0() : ws.X_WB[static_cast<std::size_t>(b.link)];
      b.X_WS = fcl_transform(X_WL) * b.X_LS;
    }
  }

  const Contact* advance(double t_s, const Eigen::VectorXd& q, std::span<const Obstacle> obstacles);
  void follow(std::span<const Obstacle> obstacles);
  bool anything_due(double share) const;
  bool look(double t_s, double share, const Eigen::VectorXd& q);
  double budget(double d) const {
    return std::max(0.0, d - std::max(0.9 * clearance_min_m, kFinest_m) - kFinest_m);
  }
  void touch(double t_s, const Eigen::VectorXd& q, const Body& body, const Solid& other,
             const Isometry3d& X_WO);
  bool caused_by_arm(double t_s, const Eigen::VectorXd& q, int link, const Vector3d& p_W,
                     const Vector3d& n_W);

  model::Chain chain;
  rbd::Workspace ws;
  std::vector<Body> bodies;
  std::vector<double> size_m;
  std::vector<SelfPair> self_pairs;
  Eigen::MatrixXd levers;
  std::vector<double> travel_m, step_m;  // of each link: so far, and in this step
  std::vector<Other> others;
  std::set<std::uint32_t> seen;  // obstacles that were there once
  std::deque<std::pair<double, Eigen::VectorXd>> past;
  double clearance_min_m = kInf;
  Contact contact;
  bool begun = false;
};

// Matches the obstacles with those of the state before; new ones stand where they are.
void Judge::Impl::follow(std::span<const Obstacle> obstacles) {
  const bool same = others.size() == obstacles.size() &&
                    std::equal(others.begin(), others.end(), obstacles.begin(),
                               [](const Other& a, const Obstacle& b) { return a.now.id == b.id; });
  if (!same) {
    std::vector<Other> next;
    for (const Obstacle& o : obstacles) {
      const auto old =
          std::find_if(others.begin(), others.end(), [&](const Other& x) { return x.now.id == o.id; });
      if (old != others.end()) {
        next.push_back(std::move(*old));
        old->now.id = ~o.id;
      } else {
        next.push_back({o, o, nullptr});
        next.back().unheard = seen.insert(o.id).second;
      }
    }
    others = std::move(next);
  }
  for (std::size_t k = 0; k < obstacles.size(); ++k) {
    Other& x = others[k];
    const bool reshaped = !x.solid || x.now.shape.kind != obstacles[k].shape.kind ||
                          x.now.shape.dims_m != obstacles[k].shape.dims_m;
    x.then = x.fresh ? obstacles[k] : x.now;
    x.now = obstacles[k];
    if (!reshaped) continue;
    x.solid = fcl_solid(x.now.shape);
    x.size_m = extent(x.now.shape);
    x.due_m.assign(bodies.size(), -kInf);
  }
}

// How far an obstacle goes in this step.
double step_of(const Obstacle& then, const Obstacle& now, double size_m) {
  const double turned = (now.X_WO.R - then.X_WO.R).norm();  // >= the chord of a unit arm
  return (now.X_WO.p - then.X_WO.p).norm() + (turned > 1e-12 ? turned * size_m : 0);
}

// Some pair will have used up its distance at this share of the step.
bool Judge::Impl::anything_due(double share) const {
  const auto gone = [&](int link) {
    return link < 0
               ? 0
               : travel_m[static_cast<std::size_t>(link)] + share * step_m[static_cast<std::size_t>(link)];
  };
  for (const SelfPair& p : self_pairs)
    if (gone(bodies[static_cast<std::size_t>(p.a)].link) + gone(bodies[static_cast<std::size_t>(p.b)].link) >=
        p.due_m)
      return true;
  for (const Other& o : others) {
    const double there = o.travel_m + share * step_of(o.then, o.now, o.size_m);
    for (std::size_t k = 0; k < bodies.size(); ++k)
      if (gone(bodies[k].link) + there >= o.due_m[k]) return true;
  }
  return false;
}

// Distances of all pairs that are due at this share of the step; false and `contact` at a touch.
bool Judge::Impl::look(double t_s, double share, const Eigen::VectorXd& q) {
  place(q);
  const auto gone = [&](const Body& b) {
    return b.link < 0 ? 0 : travel(b.link) + share * step_m[static_cast<std::size_t>(b.link)];
  };
  for (SelfPair& p : self_pairs) {
    const Body &a = bodies[static_cast<std::size_t>(p.a)], &b = bodies[static_cast<std::size_t>(p.b)];
    const double there = gone(a) + gone(b);
    if (there < p.due_m) continue;
    const double d = distance(a.solid, a.X_WS, b.solid, b.X_WS);
    clearance_min_m = std::min(clearance_min_m, d);
    p.due_m = there + budget(d);
    if (d > 0) continue;
    contact = {t_s, "link " + chain.link(std::max(a.link, b.link)).name, 0, true, true};
    contact.other = static_cast<std::uint32_t>(std::max(std::min(a.link, b.link), 0));
    return false;
  }
  for (Other& o : others) {
    const double there = o.travel_m + share * step_of(o.then, o.now, o.size_m);
    Obstacle at = o.now;
    at.X_WO.p = o.then.X_WO.p + share * (o.now.X_WO.p - o.then.X_WO.p);
    const Isometry3d X_WO = fcl_transform(at.shape, at.X_WO);
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const Body& b = bodies[k];
      if (gone(b) + there < o.due_m[k] || (b.link < 0 && there == 0)) continue;
      const double d = distance(b.solid, b.X_WS, o.solid, X_WO);
      clearance_min_m = std::min(clearance_min_m, d);
      o.due_m[k] = gone(b) + there + budget(d);
      if (d > 0) continue;
      contact = {t_s, b.link < 0 ? "base" : "link " + chain.link(b.link).name, o.now.id, false, false};
      if (!o.unheard) touch(t_s, q, b, o.solid, X_WO);
      return false;
    }
  }
  return true;
}

// Fills in who caused the touch.
void Judge::Impl::touch(double t_s, const Eigen::VectorXd& q, const Body& body, const Solid& other,
                        const Isometry3d& X_WO) {
  if (body.link < 0) return;
  fcl::CollisionRequestd request(1, true);
  fcl::CollisionResultd result;
  fcl::collide(body.solid.get(), body.X_WS, other.get(), X_WO, request, result);
  Vector3d p_W = 0.5 * (body.X_WS.translation() + X_WO.translation());
  Vector3d n_W = X_WO.translation() - body.X_WS.translation();
  if (result.numContacts() > 0) {
    p_W = result.getContact(0).pos;
    n_W = result.getContact(0).normal;
  }
  contact.arm_caused = caused_by_arm(t_s, q, body.link, p_W, n_W.normalized());
}

bool Judge::Impl::caused_by_arm(double t_s, const Eigen::VectorXd& q, int link, const Vector3d& p_W,
                                const Vector3d& n_W) {
  const auto i = static_cast<std::size_t>(link);
  rbd::positions(chain, q, ws);
  const Vector3d p_L = ws.X_WB[i].R.transpose() * (p_W - ws.X_WB[i].p);
  double later_s = t_s;
  Vector3d later = p_W;
  for (auto at = past.rbegin(); at != past.rend(); ++at) {
    if (at->first >= later_s) continue;
    rbd::positions(chain, at->second, ws);
    const Vector3d earlier = ws.X_WB[i] * p_L;
    if (n_W.dot(later - earlier) > kCausing_mps * (later_s - at->first)) return true;
    later = earlier;
    later_s = at->first;
  }
  return false;
}

const Contact* Judge::Impl::advance(double t_s, const Eigen::VectorXd& q,
                                    std::span<const Obstacle> obstacles) {
  follow(obstacles);
  const bool first = !begun;
  begun = true;
  if (first) past.emplace_back(t_s, q);
  const Eigen::VectorXd q_then = past.back().second;
  const double t_then = past.back().first;
  const Eigen::VectorXd dq = q - q_then;
  double farthest = 0, fastest = 0;
  step_m.assign(travel_m.size(), 0.0);
  for (std::size_t i = 0; i < step_m.size(); ++i) {
    step_m[i] = levers.row(static_cast<Eigen::Index>(i)).dot(dq.cwiseAbs().transpose());
    farthest = std::max(farthest, step_m[i]);
  }
  for (const Other& o : others) fastest = std::max(fastest, step_of(o.then, o.now, o.size_m));
  bool clear = true;
  const double together = std::max(farthest + fastest, self_pairs.empty() ? 0 : 2 * farthest);
  const int parts = first ? 1 : std::max(1, static_cast<int>(std::ceil(together / kFinest_m)));
  if (first || anything_due(1)) {
    for (int k = 1; k <= parts && clear; ++k) {
      const double share = static_cast<double>(k) / parts;
      if (parts == 1 || anything_due(share))
        clear = look(t_then + share * (t_s - t_then), share, q_then + share * dq);
    }
  }
  for (std::size_t i = 0; i < step_m.size(); ++i) travel_m[i] += step_m[i];
  for (Other& o : others) {
    o.travel_m += step_of(o.then, o.now, o.size_m);
    o.fresh = o.unheard = false;
  }
  if (!first) past.emplace_back(t_s, q);
  while (past.size() > 2 && past[1].first < t_s - kCausingWithin_s) past.pop_front();
  return clear ? nullptr : &contact;
}

Judge::Judge(const scene::Robot& robot) : impl_(std::make_unique<Impl>(robot)) {}
Judge::~Judge() = default;
Judge::Judge(Judge&&) noexcept = default;

double Judge::clearance(const Eigen::VectorXd& q, std::span<const Obstacle> obstacles) {
  double d = kInf;
  for (int link = -1; link < impl_->chain.n(); ++link) d = std::min(d, clearance_of_link(link, q, obstacles));
  return d;
}

double Judge::self_clearance(const Eigen::VectorXd& q) {
  impl_->place(q);
  double d = kInf;
  for (const auto& p : impl_->self_pairs) {
    const auto &a = impl_->bodies[static_cast<std::size_t>(p.a)],
               &b = impl_->bodies[static_cast<std::size_t>(p.b)];
    d = std::min(d, distance(a.solid, a.X_WS, b.solid, b.X_WS));
  }
  return d;
}

double Judge::clearance_of_link(int link, const Eigen::VectorXd& q, std::span<const Obstacle> obstacles) {
  impl_->place(q);
  double d = kInf;
  for (const Obstacle& o : obstacles) {
    const Solid other = fcl_solid(o.shape);
    const Isometry3d X_WO = fcl_transform(o.shape, o.X_WO);
    for (const Impl::Body& b : impl_->bodies)
      if (b.link == link) d = std::min(d, distance(b.solid, b.X_WS, other, X_WO));
  }
  return d;
}

const Contact* Judge::advance(double t_s, const Eigen::VectorXd& q, std::span<const Obstacle> obstacles) {
  return impl_->advance(t_s, q, obstacles);
}

double Judge::clearance_min_m() const noexcept { return impl_->clearance_min_m; }

}  // namespace hamel::client
