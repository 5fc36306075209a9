#include "common/model/screws.h"

#include <cmath>
#include <utility>

#include "common/base/text.h"

namespace hamel::model {
namespace {

constexpr double kPitchTolerance = 1e-9;

/// Frame of a link: axes of X_B0L, origin on the joint's axis.
lie::Pose frame_on_axis(const Screw& s) {
  lie::Pose X = s.X_B0L;
  if (s.kind == JointKind::prismatic) return X;
  const Eigen::Vector3d omega = s.S_B0.head<3>(),
                        r = omega.cross(s.S_B0.tail<3>());  // r: nearest to the base
  X.p = r + omega * omega.dot(X.p - r);
  return X;
}

/// The same body in a frame with the same axes and another origin.
Inertia seen_from(const Inertia& body, const lie::Pose& X_B0L, const lie::Pose& X_B0B) {
  Inertia moved = body;
  moved.com_m += X_B0B.R.transpose() * (X_B0L.p - X_B0B.p);
  return moved;
}

void check(const Screw& s, std::size_t i, Problems& out) {
  const std::string where = "joint " + (s.name.empty() ? std::to_string(i) : s.name) + ".S_B0";
  const bool slides = s.kind == JointKind::prismatic;
  const Eigen::Vector3d omega = s.S_B0.head<3>(), v = s.S_B0.tail<3>();
  if (slides && !omega.isZero(0)) out.push_back({where, "of a prismatic joint has an angular part"});
  const double pitch = omega.dot(v), reach = 1 + v.norm();
  if (!slides && !(std::abs(pitch) <= kPitchTolerance * reach))
    out.push_back({where, "has pitch " + text(pitch) + ", must be 0"});
}

}  // namespace

Checked<Chain> build(const ScrewSpec& spec) {
  Problems found;
  ChainSpec chain;
  chain.name = spec.name, chain.X_WB0 = spec.X_WB0, chain.gravity_W_mps2 = spec.gravity_W_mps2;
  lie::Pose X_B0P;  // frame before
  for (std::size_t i = 0; i < spec.joints.size(); ++i) {
    const Screw& s = spec.joints[i];
    check(s, i, found);
    const lie::Pose X_B0B = frame_on_axis(s);
    const Eigen::Vector3d axis = s.kind == JointKind::prismatic ? s.S_B0.tail<3>() : s.S_B0.head<3>();
    chain.joints.push_back({.name = s.name,
                            .kind = s.kind,
                            .X_PJ = inverse(X_B0P) * X_B0B,
                            .axis = X_B0B.R.transpose() * axis,
                            .limits = s.limits,
                            .damping = s.damping,
                            .armature = s.armature});
    chain.links.push_back({.name = s.name, .inertia = seen_from(s.inertia, s.X_B0L, X_B0B)});
    X_B0P = X_B0B;
  }
  chain.X_NE = inverse(X_B0P) * spec.X_B0E;
  auto built = build(std::move(chain));
  if (!built) found.insert(found.end(), built.error().begin(), built.error().end());
  if (!found.empty()) return found;
  return built;
}

}  // namespace hamel::model
