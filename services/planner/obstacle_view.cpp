#include "services/planner/obstacle_view.h"

#include <algorithm>
#include <cmath>

namespace hamel::planner {

namespace {

constexpr std::size_t kMaxWaiting = 64;  ///< sets ahead of time kept for one source
constexpr std::size_t kMaxSources = 16;

}  // namespace

void ObstacleView::begin(std::uint64_t incarnation) {
  incarnation_ = incarnation;
  std::erase_if(sources_, [&](const auto& s) {
    return s.second.empty() || s.second.front().incarnation < incarnation;
  });
}

void ObstacleView::add(const wire::ObstacleSet& set) {
  if (set.incarnation < incarnation_) return;
  if (!sources_.contains(set.source) && sources_.size() >= kMaxSources) return;
  Queue& q = sources_[set.source];
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

double ObstacleView::at(double t_s, std::vector<geometry::Obstacle>& out, wire::Causes& causes) {
  out.clear();
  double oldest = 0;
  bool any = false;
  set_ = 1469598103934665603ull;  // FNV-1a
  for (auto& [source, q] : sources_) {
    while (q.size() > 1 && q[1].t_s <= t_s) q.pop_front();
    if (!current(q)) continue;
    any = true;
    const wire::ObstacleSet& s = q.front();
    out.insert(out.end(), s.obstacles.begin(), s.obstacles.end());
    causes.add(wire::ServiceKind::perception, s.sequence_number);
    for (const std::uint64_t part :
         {std::uint64_t{source}, std::uint64_t{s.incarnation}, std::uint64_t{s.sequence_number}})
      set_ = (set_ ^ part) * 1099511628211ull;
    if (std::isfinite(s.next_t_s)) oldest = std::max(oldest, t_s - s.t_s);
  }
  return any ? oldest : std::numeric_limits<double>::infinity();
}

}  // namespace hamel::planner
