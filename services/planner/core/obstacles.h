#pragma once
/// The obstacles a cycle sees: which of a set may matter, and where they are by now.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/shape.h"
#include "common/geometry/solid.h"
#include "common/scene/scene.h"
#include "services/planner/core/memory.h"

namespace hamel::planner {

/// Where the arm can be at all: nothing of it is farther than radius_m from centre_W.
struct Workspace {
  Eigen::Vector3d centre_W = Eigen::Vector3d::Zero();
  double radius_m = 0;
};
Workspace workspace(const scene::Robot& robot);

/// Obstacles that come no nearer than this (or rho0) to the workspace are not seen.
inline constexpr double kSeen_m = 0.5;
/// True where an obstacle may be seen while its set holds.
bool in_reach(const Workspace& workspace, const geometry::Obstacle& o,
              const scene::PlannerOptions& options) noexcept;

/// The obstacles of this cycle: extrapolated to now, in order of their ids (then of the input), only finite
/// ones, and only those that come within kSeen_m (or rho0) of the workspace while their set holds.
class Obstacles {
 public:
  static constexpr std::size_t kMost = 4096;  ///< more are a fault of whoever sends them: too_many()
  explicit Obstacles(const Workspace& workspace = {{}, scene::kInf});
  /// Takes a set `age_s` old at time t_s.  A moving obstacle goes on with its twist.  One of unknown velocity
  /// is watched: from its second set on it goes on with the velocity between the last two (the mean of that
  /// and the one before), until then, or where none can be made out, it stays and grows.
  /// @param set  a number that changes with the set; while it stays (not 0), obstacles that were out of reach
  ///             are not looked at again
  void take(std::span<const geometry::Obstacle> stamped, double t_s, double age_s,
            const scene::PlannerOptions& o, Memory& memory, std::uint64_t set = 0) noexcept;

  struct Item {
    geometry::Obstacle now;
    geometry::Solid solid{};  ///< the same, for distances
    double inflation_m = 0;   ///< 2 sigma + assumed speed times age + a/2 age^2
    std::size_t order = 0;    ///< in the input
  };
  std::span<const Item> items() const noexcept { return items_; }
  int velocities_estimated() const noexcept { return estimated_; }
  int velocities_unknown() const noexcept { return unknown_; }
  bool all_finite() const noexcept { return all_finite_; }
  bool too_many() const noexcept { return too_many_; }
  /// The number of the set taken last (0: not known) and its age.
  std::uint64_t set() const noexcept { return set_; }
  double age_s() const noexcept { return age_s_; }
  /// No surface of items() has come nearer to anything by more than this a second since the set came; +inf
  /// where one turns.
  double fastest_mps() const noexcept { return fastest_mps_; }

 private:
  void sift(std::span<const geometry::Obstacle> stamped, const scene::PlannerOptions& o) noexcept;

  Workspace workspace_;
  std::vector<Item> items_;
  std::vector<std::size_t> near_;  ///< of the set, in order of ids
  std::uint64_t set_ = 0;
  std::size_t set_size_ = 0;
  double age_s_ = 0, fastest_mps_ = 0;
  int estimated_ = 0, unknown_ = 0;
  bool all_finite_ = true, too_many_ = false;
};

}  // namespace hamel::planner
