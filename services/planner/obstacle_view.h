#pragma once
/// What the planner knows of the obstacles at a sample time, from sets that may come early, late, twice or
/// from several sources.  Pure.

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <vector>

#include "common/wire/messages.h"

namespace hamel::planner {

class ObstacleView {
 public:
  /// Knows sets of this incarnation of the arm only, from now on: those of an earlier one are forgotten and
  /// not taken any more, those of a later one wait for it.
  void begin(std::uint64_t incarnation);

  /// Keeps a set until a newer one covers its time.  A set older than one already used, or one that is held
  /// already, is passed over; a raised incarnation starts its source afresh.
  void add(const wire::ObstacleSet& set);

  /// True when every source that ever spoke has a set for `t_s` and no later one for it can come (lockstep).
  /// False before the first set.
  bool covers(double t_s) const;

  /// Puts the newest sets not younger than `t_s` together, in the order of their sources.  Returns the age of
  /// the oldest of them [s], 0 for sets that promised no successor, +inf where there is none.
  double at(double t_s, std::vector<geometry::Obstacle>& out, wire::Causes& causes);

  /// A number that changes with what at() last put together but its age; never 0 behind it.
  std::uint64_t set() const { return set_; }

 private:
  using Queue = std::deque<wire::ObstacleSet>;  // ordered by time, of one incarnation
  bool current(const Queue& q) const { return !q.empty() && q.front().incarnation == incarnation_; }
  std::uint64_t incarnation_ = 0;
  std::map<std::uint32_t, Queue> sources_;
  std::uint64_t set_ = 0;
};

}  // namespace hamel::planner
