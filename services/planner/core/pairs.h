#pragma once
/// Which obstacle is near which link, and all that a force between the two needs.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/distance.h"
#include "common/geometry/shape.h"
#include "common/scene/scene.h"
#include "services/planner/core/arm.h"
#include "services/planner/core/memory.h"

namespace hamel::planner {

/// The obstacles of this cycle: extrapolated to now, in order of their ids (then of the input), only finite
/// ones.
class Obstacles {
 public:
  static constexpr std::size_t kMost = 4096;
  Obstacles();
  /// Takes a set `age_s` old.  A moving obstacle goes on with its twist; one of unknown velocity stays and
  /// grows.
  void take(std::span<const geometry::Obstacle> stamped, double age_s,
            const scene::PlannerOptions& o) noexcept;

  struct Item {
    geometry::Obstacle now;
    double inflation_m = 0;  ///< 2 sigma + assumed speed times age
    std::size_t order = 0;   ///< in the input
  };
  std::span<const Item> items() const noexcept { return items_; }
  bool all_finite() const noexcept { return all_finite_; }
  bool too_many() const noexcept { return too_many_; }

 private:
  std::vector<Item> items_;
  bool all_finite_ = true, too_many_ = false;
};

/// A link shape and an obstacle within reach of its influence; world frame.
struct Pair {
  int shape = 0, link = 0;     ///< shapes are counted from base to tip
  std::uint32_t obstacle = 0;  ///< id
  const Obstacles::Item* item = nullptr;
  geometry::Closest at;
  double d = 0;                                  ///< distance the laws see: inflation taken off [m]
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();  ///< at.normal, or the held one where that is a convention
  Eigen::Vector3d v = Eigen::Vector3d::Zero();   ///< of the link at its witness point
  Eigen::Vector3d v_obstacle = Eigen::Vector3d::Zero();  ///< of the obstacle at its own
  Eigen::Vector3d v_relative = Eigen::Vector3d::Zero();
  Eigen::Matrix3d Lam = Eigen::Matrix3d::Zero();  ///< operational inertia at the witness point
  Eigen::Vector3d gyroscopic = Eigen::Vector3d::Zero(),
                  repulsive = Eigen::Vector3d::Zero();  ///< [N], for the report
  double multiplier = 0;                                ///< of the barrier [N]
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();       ///< turning axis used
};

/// Pairs in range in the order (link, shape, obstacle id), and each link's nearest obstacle.
class Pairs {
 public:
  Pairs(const scene::Robot& robot, const scene::PlannerOptions& options);

  void clear() noexcept;
  /// Distances of every link shape to every obstacle; those within rho0 become pairs.  Links whose floor is
  /// above rho0 and above the clearance of the others are passed over (Input::link_floor_m).
  void find(const Arm& arm, const Obstacles& obstacles, std::span<const double> link_floor_m = {}) noexcept;
  /// The same pairs `ahead_s` later, the arm having gone there too.
  void advance(const Arm& arm, double ahead_s) noexcept;
  /// Velocities, Jacobians and operational inertias of the pairs.
  void complete(const Arm& arm) noexcept;

  std::span<Pair> items() noexcept { return {pairs_.data(), count_}; }
  std::span<const Pair> items() const noexcept { return {pairs_.data(), count_}; }
  /// J (3 x n) at the witness point of pair k.
  auto J(std::size_t k) noexcept { return J_.middleCols(static_cast<Eigen::Index>(k) * n_, n_); }
  auto J(std::size_t k) const noexcept { return J_.middleCols(static_cast<Eigen::Index>(k) * n_, n_); }

  /// The nearest obstacle of each link, true distance, whatever the range; obstacle null where there is none.
  struct Nearest {
    const Obstacles::Item* item = nullptr;
    int shape = 0;
    geometry::Closest at;
  };
  std::span<const Nearest> nearest() const noexcept { return nearest_; }
  double clearance_m() const noexcept { return clearance_m_; }
  int dropped() const noexcept { return dropped_; }
  /// Radius about the end effector that a target must have free [m].
  double tip_radius_m() const noexcept { return tip_radius_m_; }

 private:
  struct Body {
    int index = 0, link = 0;
    geometry::Capsule capsule_B;
  };
  geometry::Capsule link_W(const Arm& arm, int shape) const noexcept;
  void measure(const Body& body, const Arm& arm, const Obstacles& obstacles) noexcept;
  void offer(const Pair& pair) noexcept;
  void keep_nearest_of_each_link() noexcept;

  const scene::PlannerOptions& options_;
  std::vector<Body> bodies_;
  std::vector<Pair> pairs_;
  std::size_t count_ = 0;
  std::vector<Nearest> nearest_;
  Eigen::Index n_ = 0;
  Eigen::MatrixXd J_, MJ_;  ///< all Jacobians side by side; M^-1 J^T of one
  double clearance_m_ = 0, tip_radius_m_ = 0;
  int dropped_ = 0;
};

}  // namespace hamel::planner
