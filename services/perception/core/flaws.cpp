#include "services/perception/core/flaws.h"

#include <cmath>
#include <numbers>

#include "common/base/random.h"

namespace hamel::perception {
namespace {

/// A stream of random numbers for each seed, set and obstacle.
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t set, std::uint64_t id) : random_(seed) {
    for (const std::uint64_t word : {set, id})
      random_ = SplitMix64(random_.next() ^ (word * SplitMix64::kStep));
  }
  /// In (0, 1).
  double uniform() { return random_.unit() + 0x1p-54; }
  double normal() {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  SplitMix64 random_;
};

bool is_seen(const scene::Flaws& f, const Eigen::Vector3d& p_W) {
  const Eigen::Vector3d d = p_W - f.eye_m;
  if (d.norm() > f.range_m) return false;
  return d.isZero() || std::atan2(f.look.cross(d).norm(), f.look.dot(d)) <= f.view_rad;
}

}  // namespace

void apply(const scene::Flaws& flaws, std::uint64_t set, std::vector<geometry::Obstacle>& obstacles) {
  std::erase_if(obstacles, [&](geometry::Obstacle& o) {
    Dice dice(flaws.seed, set, o.id);
    if (dice.uniform() < flaws.dropout || !is_seen(flaws, o.X_WO.p)) return true;
    if (flaws.noise_m == 0) return false;
    for (Eigen::Index i = 0; i < 3; ++i) o.X_WO.p[i] += flaws.noise_m * dice.normal();
    o.sigma_m = std::hypot(o.sigma_m, flaws.noise_m);
    return false;
  });
}

}  // namespace hamel::perception
