#pragma once
/// Drawing the scenes of `hamel bench planner`.

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "clients/hamel/bench_families.h"
#include "common/base/random.h"

namespace hamel::client {

/// Random numbers and directions.
class Dice : public SplitMix64 {
 public:
  using SplitMix64::SplitMix64;
  Eigen::Vector3d direction() {
    for (;;) {
      const Eigen::Vector3d v(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      if (v.norm() > 0.1 && v.norm() <= 1) return v.normalized();
    }
  }
};

inline bool is_planar(const Cell& cell) {
  return cell.family.starts_with("planar") || cell.family.starts_with("example_5_2");
}
inline bool is_moving(const Cell& cell) { return cell.family.ends_with("moving"); }

/// The arm at rest with a goal numbered 1 and nothing else; ends when it is reached.
scene::Scene empty_scene(const scene::Robot& robot);
/// Within the joints' limits, evenly.
Eigen::VectorXd random_configuration(const model::Chain& chain, Dice& dice);
/// Of a slender rod of 1 m and 1 kg along x; a little about its own axis.
inline const Eigen::Vector3d kRod_kgm2(1e-3, 1.0 / 12, 1.0 / 12);
/// Four links of 1 m and 1 kg in the x-y plane, capsules; `inertia` about each axis of a link [kg m^2].
scene::Robot planar_arm(const Eigen::Vector3d& inertia_kgm2, double radius_m);

/// A scene of the random families.  A problem where no start and goal fit in many tries, or `stop` says so.
Checked<scene::Scene> draw_random(const Cell& cell, const scene::Robot& robot, std::uint64_t seed,
                                  const std::function<bool()>& stop);
/// Example 5.2 with everything moved a little: centre and target +-0.4 and +-0.5 m, radius 0.15 to 0.35 m,
/// joints +-0.1 rad.
scene::Scene draw_example_5_2(const scene::Robot& robot, std::uint64_t seed);

/// One setting of the grid example 5.2 is swept with; links without thickness.
struct GridPoint {
  double kp = 4, zeta = 1, damping = 0.5;
  double dt_s = 1e-3;
  bool rods = false;  ///< slender rods; else inertia 1 kg m^2 about each axis
  double q0_rad = 0;  ///< of each joint
};
inline constexpr std::size_t kGridPoints = 192;
/// Point `index` < kGridPoints of kp 2, 4, 10, 25 x zeta 0.5, 1, 2 x damping 0.5, 2 x step 1, 10 ms x inertia
/// x start 0, 0.05 rad; the last fastest.
GridPoint grid_point(std::size_t index) noexcept;
scene::Scene draw_grid_point(std::size_t index);

}  // namespace hamel::client
