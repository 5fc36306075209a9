#include "services/planner/core/force_law.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace hamel::planner {

using Eigen::Vector3d;
using scene::GainForm;

double smooth_step(double u) noexcept {
  const double c = std::clamp(u, 0.0, 1.0);
  return c * c * (3 - 2 * c);
}

double approach_angle(const Vector3d& n, const Vector3d& v) noexcept {
  return std::atan2(n.cross(v).norm(), n.dot(v));
}

Vector3d khatib_force(const scene::PlannerOptions& o, const Vector3d& n, double d) noexcept {
  if (d > o.rho0_m) return Vector3d::Zero();
  const double near = std::max(d, kNearest_m);
  return -n * o.eta * std::max(1 / near - 1 / o.rho0_m, 0.0) / (near * near);
}

double gyro_gate(const scene::PlannerOptions& o, GainForm form, const Vector3d& n, double d,
                 const Vector3d& v) noexcept {
  const double closing = n.dot(v), speed = v.norm();
  if (d > o.rho0_m || closing <= 0 || speed < kSlowest_mps) return 0;
  if (form == GainForm::S) return smooth_step(1 - d / o.rho0_m) * smooth_step(closing / speed / o.c0);
  return 1 / (1 + std::exp(d - o.rho0_m));
}

double gate(const scene::PlannerOptions& o, const Vector3d& n, double d, const Vector3d& v) noexcept {
  switch (o.method) {
    case scene::Method::attract:
      return 0;
    case scene::Method::khatib:
      return d > o.rho0_m ? 0 : 1;
    case scene::Method::gyro_paper:
      return gyro_gate(o, o.gain_form, n, d, v);
    case scene::Method::gyro:
      return gyro_gate(o, GainForm::S, n, d, v);
  }
  return 0;
}

double gyro_gain(const scene::PlannerOptions& o, GainForm form, const Vector3d& n, double d,
                 const Vector3d& v) noexcept {
  const double open = gyro_gate(o, form, n, d, v);
  if (open == 0) return 0;
  const double near = std::max(d, kNearest_m);
  if (form == GainForm::S) return o.kobs * n.dot(v) / near * open;
  const double phi = approach_angle(n, v);
  const double G = form == GainForm::F1   ? std::expm1(phi)
                   : form == GainForm::F2 ? std::exp(1 / std::max(phi, o.phi_min_rad))
                                          : std::exp(phi - 1);
  return o.kobs * G / near * open;
}

Vector3d paper_rotation(const scene::PlannerOptions& o, const Vector3d& n, double d,
                        const Vector3d& v) noexcept {
  const Vector3d across = n.cross(v);
  const double length = across.norm();
  if (!(length > 0)) return Vector3d::Zero();
  return gyro_gain(o, o.gain_form, n, d, v) / length * across;
}

Vector3d turning_axis(const Vector3d& n, const Vector3d& v, const Vector3d& preferred) noexcept {
  const double speed = v.norm();
  if (speed < kSlowest_mps) return preferred;
  const Vector3d raw = n.cross(v) / speed;
  const Vector3d e = raw + 0.2 * std::max(0.0, 1 - raw.norm() / 0.17) * preferred;
  const double length = e.norm();
  return length > 1e-12 ? Vector3d(e / length) : Vector3d::Zero();
}

}  // namespace hamel::planner
