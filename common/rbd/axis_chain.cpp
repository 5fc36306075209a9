#include "common/rbd/axis_chain.h"

#include <algorithm>
#include <cmath>

namespace hamel::rbd {
namespace {

/// Mass and weight beyond each joint, from the tip: what the arm weighs when stretched out level.
void sum_outward(std::vector<AxisLink>& links, double gravity, double& energy_scale) {
  double mass = 0, moment = 0;  // moment: sum of mass times stretched distance from this joint
  for (std::size_t i = links.size(); i-- > 0;) {
    AxisLink& k = links[i];
    mass += k.mass;
    moment += std::sqrt(dot(k.h, k.h));
    k.outer_mass = mass;
    k.weight = gravity * (k.prismatic ? mass : moment);
    energy_scale = gravity * moment;
    moment += mass * std::sqrt(dot(k.p_PJ, k.p_PJ));
  }
}

}  // namespace

Eigen::Matrix3d frame_about(const Eigen::Vector3d& axis) {
  if (axis == Eigen::Vector3d::UnitZ()) return Eigen::Matrix3d::Identity();
  Eigen::Index least = 0;
  axis.cwiseAbs().minCoeff(&least);
  Eigen::Matrix3d R;
  R.col(2) = axis.normalized();
  R.col(0) = Eigen::Vector3d::Unit(least).cross(R.col(2)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return R;
}

AxisChain::AxisChain(const model::Chain& chain) : links(static_cast<std::size_t>(chain.n())) {
  assign(chain);
}

void AxisChain::assign(const model::Chain& chain) noexcept {
  gravity_W = lie::vec3(chain.gravity_W_mps2());
  lie::Pose X_PZ =
      chain.X_WB0();  // parent link's frame seen from the parent's axis frame; the base from the world
  for (int i = 0; i < chain.n(); ++i) {
    const model::Joint& joint = chain.joint(i);
    const model::Inertia& body = chain.link(i).inertia;
    const Eigen::Matrix3d R_BZ = frame_about(joint.axis);
    const lie::Pose X = X_PZ * joint.X_PJ;
    const Eigen::Vector3d c = R_BZ.transpose() * body.com_m;
    const Eigen::Matrix3d about_com = R_BZ.transpose() * body.about_com_kgm2 * R_BZ;
    const Eigen::Matrix3d shift = c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose();
    AxisLink& a = links[static_cast<std::size_t>(i)];
    a.R_PJ = lie::mat3(X.R * R_BZ);
    a.p_PJ = lie::vec3(X.p);
    a.mass = body.mass_kg;
    a.h = lie::vec3(body.mass_kg * c);
    a.I_o = lie::sym3(about_com + body.mass_kg * shift);
    a.moment_size = std::abs(a.h.x) + std::abs(a.h.y) + std::abs(a.h.z);
    a.inertia_size = std::max({a.I_o.xx, a.I_o.yy, a.I_o.zz});
    a.damping = joint.damping;
    a.armature = joint.armature;
    a.lower = joint.limits.lower;
    a.upper = joint.limits.upper;
    a.prismatic = joint.kind == model::JointKind::prismatic;
    X_PZ = {R_BZ.transpose(), Eigen::Vector3d::Zero()};
  }
  sum_outward(links, chain.gravity_W_mps2().norm(), energy_scale);
}

}  // namespace hamel::rbd
