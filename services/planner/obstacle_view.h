#pragma once
/// What the planner knows of the obstacles at a sample time, from sets that may come early, late, twice or
/// from several sources.  Pure.

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "common/scene/outward.h"
#include "common/scene/reach.h"
#include "common/wire/messages.h"
#include "services/planner/core/obstacles.h"
#include "services/planner/core/savings.h"

namespace hamel::planner {

/// What the scene's reductions `self` and `requery` spare a planner.
Savings savings(const scene::Scene& scene);

class ObstacleView {
 public:
  /// Shows every obstacle.
  ObstacleView() = default;
  /// Leaves out what the scene's reductions `obstacles` and `links` allow, the planner's commands are the
  /// same; puts together what `merge` allows.
  explicit ObstacleView(const scene::Scene& scene);
  ObstacleView(const ObstacleView&) = delete;  // what it shows points into it
  ObstacleView& operator=(const ObstacleView&) = delete;
  /// Knows sets of this incarnation of the arm only, from now on: those of an earlier one are forgotten and
  /// not taken any more, those of a later one wait for it.
  void begin(std::uint64_t incarnation);

  /// Keeps a set until a newer one covers its time.  A set older than one already used, or one that is held
  /// already, is passed over; a raised incarnation starts its source afresh.
  void add(const wire::ObstacleSet& set);

  /// True when every source that ever spoke has a set for `t_s` and no later one for it can come (lockstep).
  /// False before the first set.
  bool covers(double t_s) const;

  /// Puts the newest sets not younger than `t_s` together, in the order of their sources, for an arm at `q`.
  /// Returns the age of the oldest of them [s], 0 for sets that promised no successor, +inf where there is
  /// none.  Sets are put together and sifted once, not at each call.
  double at(double t_s, const Eigen::VectorXd& q, wire::Causes& causes);
  /// What at() found; until the next call of it or add().
  std::span<const geometry::Obstacle> obstacles() const noexcept { return shown_; }
  /// The same with nothing left out.
  std::span<const geometry::Obstacle> all() const noexcept { return all_; }
  /// For each link a distance that no obstacle comes under; empty: nothing is known (Input::link_floor_m).
  std::span<const double> link_floor_m() const noexcept { return floor_shown_; }

  /// A number that changes with obstacles(), whatever their age; not 0 after at().
  std::uint64_t set() const { return set_; }

 private:
  void put_together();

  using Queue = std::deque<wire::ObstacleSet>;  // ordered by time, of one incarnation
  bool current(const Queue& q) const { return !q.empty() && q.front().incarnation == incarnation_; }
  std::uint64_t incarnation_ = 0;
  std::map<std::uint32_t, Queue> sources_;
  std::uint64_t set_ = 0, sifts_ = 0;
  std::optional<scene::Reach> reach_;
  std::optional<scene::Merge> merge_;
  scene::PlannerOptions options_;
  Workspace workspace_;
  bool cull_ = false, skip_links_ = false;
  bool changed_ = false;      ///< other sets hold than when all_ was put together
  bool near_is_old_ = false;  ///< near_ is of other sets
  std::vector<geometry::Obstacle> all_, seen_, kept_, near_;
  std::vector<double> floor_m_;
  std::span<const geometry::Obstacle> shown_;
  std::span<const double> floor_shown_;
};

}  // namespace hamel::planner
