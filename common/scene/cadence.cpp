#include "common/scene/cadence.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamel::scene {

Cadence::Cadence(const Scene& s)
    : period_(static_cast<std::uint64_t>(s.planner.period_steps)),
      hurry_(static_cast<std::uint64_t>(s.hurry.period_steps)),
      hurry_mps_(s.hurry.mps),
      chain_(s.robot.chain),
      ws_(chain_) {
  for (const LinkShape& shape : s.robot.shapes)
    if (shape.link >= 0)
      bodies_.push_back({shape.link, shape.X_LS * geometry::enclosing_capsule(shape.shape)});
  const Eigen::Vector3d tip = chain_.X_NE().p;
  bodies_.push_back({chain_.n() - 1, {tip, tip, 0, 0}});
}

bool Cadence::due(std::uint64_t step, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) noexcept {
  if (step % period_ == 0) return true;
  if (hurry_ == 0 || step % hurry_ != 0) return false;
  return !(fastest_mps(q, qd) <= hurry_mps_);
}

double Cadence::fastest_mps(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) noexcept {
  if (!q.allFinite() || !qd.allFinite()) return kInf;
  rbd::velocities(chain_, q, qd, ws_);
  double fastest = 0;
  for (const Body& b : bodies_) {
    const lie::Twist& V_B = ws_.V_B[static_cast<std::size_t>(b.link)];
    const Eigen::Vector3d omega = V_B.head<3>(), v = V_B.tail<3>();
    const auto speed = [&](const Eigen::Vector3d& p_B) { return (v + omega.cross(p_B)).norm(); };
    fastest = std::max(fastest, std::max(speed(b.capsule_B.p0), speed(b.capsule_B.p1)) +
                                    omega.norm() * b.capsule_B.radius_m);
  }
  return fastest;
}

}  // namespace hamel::scene
