#include "common/rbd/planar_chain.h"

#include <cmath>
#include <limits>

namespace hamel::rbd {
namespace {

/// Sines of angles between axes that count as rounding of the poses they were computed from.
constexpr double kParallel = 16 * std::numeric_limits<double>::epsilon();

/// Calls visit(i, pose of link i at q = 0 in the world).
template <class Visit>
void at_zero(const model::Chain& chain, const Visit& visit) {
  lie::Pose X_WB = chain.X_WB0();
  for (int i = 0; i < chain.n(); ++i) {
    X_WB = X_WB * chain.joint(i).X_PJ;
    visit(i, X_WB);
  }
}
bool slides(const model::Joint& joint) { return joint.kind == model::JointKind::prismatic; }

/// The plane's normal: the first revolute axis; zero where there is none.
Eigen::Vector3d normal(const model::Chain& chain) {
  Eigen::Vector3d e3 = Eigen::Vector3d::Zero();
  at_zero(chain, [&](int i, const lie::Pose& X_WB) {
    if (!slides(chain.joint(i)) && e3.isZero(0)) e3 = X_WB.R * chain.joint(i).axis;
  });
  return e3;
}
lie::Vec2<double> in_plane(const Eigen::Vector3d& v) { return {v.x(), v.y()}; }

}  // namespace

bool is_planar(const model::Chain& chain) noexcept {
  const Eigen::Vector3d e3 = normal(chain);
  if (e3.isZero(0)) return false;
  bool planar = true;
  at_zero(chain, [&](int i, const lie::Pose& X_WB) {
    const Eigen::Vector3d a = X_WB.R * chain.joint(i).axis;
    const double off = slides(chain.joint(i)) ? std::abs(a.dot(e3)) : a.cross(e3).norm();
    planar = planar && off <= kParallel;
  });
  return planar;
}

PlanarChain::PlanarChain(const model::Chain& chain)
    : links(static_cast<std::size_t>(chain.n())), axis_(chain) {
  assign(chain);
}

void PlanarChain::assign(const model::Chain& chain) noexcept {
  axis_.assign(chain);
  energy_scale = axis_.energy_scale;
  R_WE = frame_about(normal(chain));
  const Eigen::Vector3d g = R_WE.transpose() * chain.gravity_W_mps2();
  gravity_W = in_plane(g);
  potential_offset = 0;
  Eigen::Vector3d p_parent = Eigen::Vector3d::Zero();
  at_zero(chain, [&](int i, const lie::Pose& X_WB) {
    const model::Joint& joint = chain.joint(i);
    const model::Inertia& body = chain.link(i).inertia;
    const Eigen::Matrix3d R_EB = R_WE.transpose() * X_WB.R;
    const Eigen::Vector3d p = R_WE.transpose() * X_WB.p, c = R_EB * body.com_m, axis = R_EB * joint.axis;
    PlanarLink& k = links[static_cast<std::size_t>(i)];
    static_cast<JointNumbers&>(k) = axis_[i];
    k.p_PJ = in_plane(p - p_parent);
    k.h = in_plane(body.mass_kg * c);
    k.axis = in_plane(axis);
    k.I_o = R_EB.row(2) * body.about_com_kgm2 * R_EB.row(2).transpose();
    k.I_o += body.mass_kg * (c.x() * c.x() + c.y() * c.y());
    k.moment_size = std::abs(k.h.x) + std::abs(k.h.y);
    k.inertia_size = k.I_o;
    k.sign = axis.z() < 0 ? -1 : 1;
    potential_offset -= body.mass_kg * g.z() * (p.z() + c.z());
    p_parent = p;
  });
}

}  // namespace hamel::rbd
