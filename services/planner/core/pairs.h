#pragma once
/// Which obstacle is near which link, and all that a force between the two needs.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/solid.h"
#include "common/scene/scene.h"
#include "services/planner/core/arm.h"
#include "services/planner/core/memory.h"
#include "services/planner/core/obstacles.h"
#include "services/planner/core/savings.h"

namespace hamel::planner {

inline constexpr int kNoLink = -2;

/// A link shape and an obstacle, or another link, within reach of its influence; world frame.
struct Pair {
  int shape = 0, link = 0;     ///< shapes are counted from base to tip
  int other_link = kNoLink;    ///< pairs of two links: the one that stands for the obstacle; -1: the base
  std::uint32_t obstacle = 0;  ///< id
  double span_m = 0;           ///< the shape is no longer than this
  const Obstacles::Item* item = nullptr;
  geometry::Closest at;
  double d = 0;                                  ///< distance the laws see: inflation taken off [m]
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();  ///< at.normal, or the held one where that is a convention
  Eigen::Vector3d v = Eigen::Vector3d::Zero();   ///< of the link at its witness point
  Eigen::Vector3d v_obstacle = Eigen::Vector3d::Zero();  ///< of the obstacle at its own
  Eigen::Vector3d v_relative = Eigen::Vector3d::Zero();
  Eigen::Matrix3d B = Eigen::Matrix3d::Zero();    ///< J M^-1 J^T at the witness point
  Eigen::Matrix3d Lam = Eigen::Matrix3d::Zero();  ///< operational inertia there
  Eigen::Vector3d gyroscopic = Eigen::Vector3d::Zero(),
                  repulsive = Eigen::Vector3d::Zero();  ///< [N], for the report
  double multiplier = 0;                                ///< of the barrier [N]
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();       ///< turning axis used
};

/// Pairs in range in the order (link, shape, obstacle id), and each link's nearest obstacle.  Behind them the
/// pairs of two links that are near each other.
class Pairs {
 public:
  static constexpr std::size_t kMaxSelf = 64;  ///< the nearest of the pairs of links in range
  static constexpr std::size_t kMost = kMaxPairs + kMaxSelf;
  static constexpr double kSelfRange_m = 0.1;  ///< pairs of links begin to count here (or at rho0)
  Pairs(const scene::Robot& robot, const scene::PlannerOptions& options, const Savings& savings = {});

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
  /// What the barrier keeps apart: items(), then the pairs of two links.
  std::span<Pair> guarded() noexcept { return {pairs_.data(), count_ + self_count_}; }
  std::span<const Pair> guarded() const noexcept { return {pairs_.data(), count_ + self_count_}; }
  /// Acceleration at qdd = 0 of a pair's point on the link, less that of the other link's point.
  Eigen::Vector3d bias(const Arm& arm, const Pair& pair) const noexcept;
  /// J (3 x n) at the witness point of pair k of guarded(); of two links: of one against the other.
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
  /// A moving obstacle is in the base, or any in a link locked onto it, which no motion of the arm can
  /// prevent.
  bool base_touched() const noexcept { return base_touched_; }
  /// Smallest distance of two links that must not touch; +inf where none are within range.
  double self_clearance_m() const noexcept { return self_clearance_m_; }
  int dropped() const noexcept { return dropped_; }
  /// The obstacle leaves less than `margin_m` to the last link with the end effector at X_WE; `turns`:
  /// however the link is turned there (then true only where the ball about the end effector inside it is too
  /// near).
  bool blocks(const Obstacles::Item& item, const lie::Pose& X_WE, bool turns, double margin_m) const noexcept;
  /// Takes a joint goal for blocks_goal().  Allocates.
  /// @param q  n values, finite
  void set_goal(const model::Chain& chain, const Eigen::VectorXd& q);
  /// The obstacle leaves less than `margin_m` to a link at the joint goal, and with `anywhere` wherever else
  /// each joint is within options.goal_tolerance_joint of it.
  bool blocks_goal(const Obstacles::Item& item, double margin_m, bool anywhere) const noexcept;

 private:
  struct Body {
    std::size_t of_robot = 0;  ///< index of its shape
    int index = 0, link = 0;
    geometry::Solid solid_B, solid_W;
    bool was_link = false;     ///< scene::LinkShape::was_link
    std::uint64_t placed = 0;  ///< solid_W is of this placing
  };
  /// Two bodies that must not touch; the first is nearer to the base.
  struct Own {
    std::size_t a = 0, b = 0;
  };
  /// What was found when a link was last asked for distances.
  struct Asked {
    Eigen::VectorXd q;
    double spare_m = 0;  ///< from range, at least; negative: in range
    double age_s = 0;
    Nearest nearest;
  };
  /// A body at the joint goal, and how far the goal's tolerance takes it.
  struct AtGoal {
    geometry::Solid solid_W;
    double slack_m = 0;
  };
  const geometry::Solid& place(const Arm& arm, Body& body) noexcept;
  void touch_base(const Arm& arm, Body& base, const Obstacles& obstacles) noexcept;
  void find_self(const Arm& arm) noexcept;
  void list_near_links(const Arm& arm) noexcept;
  void measure(const Arm& arm, Body& body, const Obstacles& obstacles) noexcept;
  bool rests(const Arm& arm, const Obstacles& obstacles, std::size_t link) const noexcept;
  void offer(const Pair& pair) noexcept;
  void complete_self(const Arm& arm, std::size_t k) noexcept;
  void keep_nearest_of_each_link() noexcept;

  const scene::PlannerOptions& options_;
  const Savings savings_;
  std::vector<Body> bodies_;
  std::vector<Own> own_,
      near_own_;  ///< near_own_: those that may come into range while the arm is near q_own_
  Eigen::VectorXd q_own_, lever_m_;  ///< lever_m_: the largest of each joint's levers
  Eigen::MatrixXd levers_m_;         ///< (joint, link)
  std::vector<Asked> asked_;         ///< each link
  std::vector<bool> rests_;
  std::uint64_t placing_ = 0, asked_set_ = 0;
  std::vector<Obstacles::Item> links_;  ///< each body as an obstacle to the others
  std::vector<Pair> pairs_;
  std::size_t count_ = 0, self_count_ = 0;
  std::vector<Nearest> nearest_;
  Eigen::Index n_ = 0;
  Eigen::MatrixXd J_, MJ_, J_other_;    ///< all Jacobians side by side; M^-1 J^T of one; the other link's
  std::vector<geometry::Solid> tip_E_;  ///< shapes of the last link, seen from the end effector
  std::vector<AtGoal> at_goal_;
  double clearance_m_ = 0, self_clearance_m_ = 0, tip_radius_m_ = 0;
  bool base_touched_ = false;
  int dropped_ = 0, shapes_ = 0;  ///< shapes_: bodies that are not the base's
};

}  // namespace hamel::planner
