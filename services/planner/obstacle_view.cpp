#include "services/planner/obstacle_view.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/scene/reduce.h"

namespace hamel::planner {

namespace {

constexpr std::size_t kMaxWaiting = 64;  ///< sets ahead of time kept for one source
constexpr std::size_t kMaxSources = 16;
constexpr std::size_t kWorthwhile = 16;  ///< fewer are measured sooner than sifted again and again
constexpr double kHorizon_s = 5;         ///< a moving obstacle is culled when it is out of reach for so long

}  // namespace

Savings savings(const scene::Scene& scene) {
  const scene::ReduceOptions& r = scene.reduce;
  return {.far_links = scene::wanted(r, r.self, true),
          .requery_m = r.requery == scene::Choice::on ? scene.accuracy.obstacle_error_m : 0};
}

ObstacleView::ObstacleView(const scene::Scene& scene)
    : options_(scene.planner),
      workspace_(workspace(scene.robot)),
      cull_(scene::wanted(scene.reduce, scene.reduce.obstacles, true)),
      skip_links_(scene::wanted(scene.reduce, scene.reduce.links, false)) {
  const bool merge = scene::wanted(scene.reduce, scene.reduce.merge, false);
  if (merge) merge_.emplace(scene.accuracy.obstacle_error_m, scene.planner.rho0_m);
  if (cull_ || skip_links_ || merge) reach_.emplace(scene.robot, scene.planner);
}

void ObstacleView::begin(std::uint64_t incarnation) {
  incarnation_ = incarnation;
  changed_ = true;
  std::erase_if(sources_, [&](const auto& s) {
    return s.second.empty() || s.second.front().incarnation < incarnation;
  });
}

void ObstacleView::add(const wire::ObstacleSet& set) {
  if (set.incarnation < incarnation_) return;
  if (!sources_.contains(set.source) && sources_.size() >= kMaxSources) return;
  Queue& q = sources_[set.source];
  changed_ = true;
  if (!q.empty() && set.incarnation < q.back().incarnation) return;
  if (!q.empty() && set.incarnation > q.back().incarnation) q.clear();
  const auto at = std::lower_bound(q.begin(), q.end(), set.t_s,
                                   [](const wire::ObstacleSet& s, double t_s) { return s.t_s < t_s; });
  if (at != q.end() && at->t_s == set.t_s) {
    *at = set;
  } else if (at != q.begin() || q.empty()) {
    q.insert(at, set);
  } else {
    return;  // older than what is in use
  }
  if (q.size() > kMaxWaiting) q.pop_front();
}

bool ObstacleView::covers(double t_s) const {
  if (sources_.empty()) return false;
  return std::all_of(sources_.begin(), sources_.end(), [t_s, this](const auto& source) {
    return current(source.second) &&
           std::any_of(source.second.begin(), source.second.end(),
                       [t_s](const wire::ObstacleSet& s) { return s.t_s <= t_s && t_s < s.next_t_s; });
  });
}

double ObstacleView::at(double t_s, const Eigen::VectorXd& q, wire::Causes& causes) {
  double oldest = 0;
  bool any = false;
  for (auto& [source, queue] : sources_) {
    while (queue.size() > 1 && queue[1].t_s <= t_s) {
      queue.pop_front();
      changed_ = true;
    }
    if (!current(queue)) continue;
    any = true;
    const wire::ObstacleSet& s = queue.front();
    causes.add(wire::ServiceKind::perception, s.sequence_number);
    if (std::isfinite(s.next_t_s)) oldest = std::max(oldest, t_s - s.t_s);
  }
  if (changed_) put_together();
  const bool sound = reach_ && oldest <= kHorizon_s && reach_->holds(q) && all_.size() <= Obstacles::kMost;
  std::uint64_t which = 1;  // of the three vectors is shown
  shown_ = all_;
  if (sound && (merge_ || cull_) && (!cull_ || kept_.size() < kWorthwhile)) {
    shown_ = kept_;
    which = 2;
  } else if (sound && cull_) {
    if (near_is_old_ || !reach_->stays_near(q)) {
      reach_->sift_near(q, kept_, near_);
      ++sifts_;
    }
    near_is_old_ = false;
    shown_ = near_;
    which = 3;
  }
  set_ = 4 * sifts_ + which;
  floor_shown_ = sound && skip_links_ ? std::span<const double>(floor_m_) : std::span<const double>();
  return any ? oldest : std::numeric_limits<double>::infinity();
}

void ObstacleView::put_together() {
  changed_ = false;
  near_is_old_ = true;
  ++sifts_;
  all_.clear();
  for (const auto& [source, queue] : sources_) {
    if (!current(queue)) continue;
    const std::size_t first = all_.size();
    all_.insert(all_.end(), queue.front().obstacles.begin(), queue.front().obstacles.end());
    for (std::size_t k = first; k < all_.size(); ++k) all_[k].seen_s = queue.front().t_s;
  }
  if (!reach_) return;
  seen_.clear();  // what the planner would not see culls nothing
  std::copy_if(all_.begin(), all_.end(), std::back_inserter(seen_), [this](const geometry::Obstacle& o) {
    return !scene::Reach::is_plain(o) || in_reach(workspace_, o, options_);
  });
  reach_->sift(seen_, kHorizon_s, kept_, floor_m_);
  if (!merge_) return;
  if (!cull_) kept_ = all_;
  merge_->apply(*reach_, kHorizon_s, kept_);
  for (double& floor : floor_m_) floor -= merge_->excess_m();
}

}  // namespace hamel::planner
