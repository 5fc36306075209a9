#pragma once
/// How far an arm reaches, whatever its joints do, and which obstacles can therefore never matter to it.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/geometry/solid.h"
#include "common/rbd/rbd.h"
#include "common/scene/scene.h"

namespace hamel::scene {

inline constexpr int kLockedOn = -2;  ///< in place of a link: those that locked joints made part of the base
/// The link of a shape, -1 for the base, or kLockedOn.
inline int part_of(const LinkShape& s) noexcept { return s.was_link ? kLockedOn : s.link; }

/// A ball that the axis of a link's capsule never leaves.
struct ReachBall {
  int link = 0;  ///< -1: the base, which only what moves may run into; kLockedOn
  Eigen::Vector3d centre_W = Eigen::Vector3d::Zero();
  double axis_m = 0;    ///< how far from the centre the capsule's axis may be; +inf: a slide without limits
  double radius_m = 0;  ///< of the capsule
};

/// How far joint j moves what is farthest out on link i, for each radian (or metre) it goes: n x n (j, i),
/// zero where joint j does not carry the link.  +inf beyond a slide without limits.  While slides keep to
/// their limits no point of the link's shapes goes farther than the sum over j of that times |dq_j|.
Eigen::MatrixXd levers(const Robot& robot);

/// The balls of a robot: about a point of the first joint's axis, offsets stretched out, slides at their
/// limits.
///
/// With s the signed distance of a ball's centre to an obstacle, the link's distance to it is always within
/// [s - axis - radius, s + axis], because a signed distance changes by no more than one walks, and the axis
/// lies in the link's solid, which lies in the capsule.
class Reach {
 public:
  Reach(const Robot& robot, const PlannerOptions& options);

  /// True while q keeps to what the balls stand on: slides within their limits.
  bool holds(const Eigen::VectorXd& q) const noexcept { return model::slides_hold(chain_, q); }

  /// Puts those of `set` that may matter within `horizon_s` into `kept`, in their order, and into `floor_m`
  /// (size n) for each link a distance (less what the planner inflates obstacles by) that none comes under in
  /// that time.
  ///
  /// An obstacle matters where it may come into the range of a force or barrier (rho0), may be the nearest to
  /// some link, or may lie over a target that the arm reaches.  What is left out changes no output of the
  /// planner.  Obstacles that turn, that do not tell their velocity, or that are not finite, are kept.
  /// O(links x obstacles).
  void sift(std::span<const geometry::Obstacle> set, double horizon_s, std::vector<geometry::Obstacle>& kept,
            std::vector<double>& floor_m);

  /// Of a sifted set, puts into `kept` what matters while the arm stays about q: drops standing obstacles out
  /// of reach that others are surely nearer than.  Good while stays_near() says so.  O(links x obstacles).
  void sift_near(const Eigen::VectorXd& q, std::span<const geometry::Obstacle> set,
                 std::vector<geometry::Obstacle>& kept);
  /// True while no link has gone farther than a margin from where it was at the last sift_near(): each joint
  /// moves what it carries by no more than its own way times the reach beyond it.  O(n).
  bool stays_near(const Eigen::VectorXd& q) const noexcept;

  std::span<const ReachBall> balls() const noexcept { return balls_; }

  /// An obstacle of finite numbers whose way is known and straight; the planner watches the others to make
  /// out how they move.
  static bool is_plain(const geometry::Obstacle& o);
  /// No link (nor the base) comes nearer to a plain obstacle within the horizon; may be negative.
  double least_distance_m(const geometry::Obstacle& o, double horizon_s) const noexcept;

 private:
  struct Body {
    int link = 0;
    geometry::Solid solid_B;
  };
  /// A point that several balls are about, and the largest of them.
  struct Centre {
    Eigen::Vector3d p_W;
    double axis_m = 0, out_m = 0;  ///< of a capsule's axis; of its surface
  };
  void add_ball(const ReachBall& ball);
  /// Links, then the base, then what is locked onto it.
  std::size_t slot(int link) const noexcept {
    return static_cast<std::size_t>(link < 0 ? chain_.n() - 1 - link : link);
  }
  void sift_roughly(std::span<const geometry::Obstacle> set, double horizon_s, std::vector<double>& floor_m);
  double spread_m(const geometry::Obstacle& o, double horizon_s) const noexcept;
  /// What the planner inflates it by at most.
  double inflation_m(const geometry::Obstacle& o) const noexcept;
  bool may_cover_target(double distance_m, double way_m, double grown_m) const noexcept;

  std::vector<ReachBall> balls_;
  std::vector<Centre> centres_;
  std::vector<std::size_t> centre_of_;  ///< each ball
  std::vector<Body> bodies_;            ///< one a ball
  ReachBall target_;  ///< where the end effector's body is when it is at a target that can be reached
  model::Chain chain_;
  rbd::Workspace ws_;
  Eigen::VectorXd q_near_, lever_m_;  ///< where the last sift_near() was; the largest of each joint's levers
  std::vector<double> near_m_, nearest_m_;  ///< scratch: distances of obstacles, and the least
  std::vector<std::size_t> left_;           ///< scratch: what sift_roughly() leaves
  double rho0_m_ = 0, margin_m_ = 0;
  double accelerated_m_ = 0;  ///< accelerated_m() of an obstacle that is almost too old
};

}  // namespace hamel::scene
