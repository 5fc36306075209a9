#include "services/perception/core/flaws.h"

#include <cmath>
#include <numbers>

namespace hamel::perception {
namespace {

/// A uniform number in (0, 1) for each count, by splitmix64 [Steele 2014].
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t set, std::uint64_t id) : state_(seed) {
    for (const std::uint64_t word : {set, id}) state_ = mixed() ^ (word * 0x9e3779b97f4a7c15ull);
  }
  double uniform() { return (static_cast<double>(mixed() >> 11) + 0.5) * 0x1p-53; }
  double normal() {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  std::uint64_t mixed() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
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
