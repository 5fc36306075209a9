#pragma once
/// The forces of one obstacle on one point, as pure functions of normal n (unit, toward the obstacle), signed
/// distance d [m] and velocity v [m/s].  A gyroscopic force is handed over as w with f = w x v: it cannot do
/// work.

#include <Eigen/Core>

#include "common/scene/options.h"

namespace hamel::planner {

/// Smallest distance any law divides by [m].
inline constexpr double kNearest_m = 1e-3;
/// Below this speed there is no direction to turn from [m/s].
inline constexpr double kSlowest_mps = 1e-9;

/// 3 u^2 - 2 u^3, clamped to [0, 1]: a gate without a jump.
double smooth_step(double u) noexcept;
/// Angle between motion and obstacle [rad].  atan2 keeps its digits where acos(n.v/|v|) loses them or leaves
/// [-1, 1].
double approach_angle(const Eigen::Vector3d& n, const Eigen::Vector3d& v) noexcept;

/// -n eta (1/d - 1/rho0)/d^2 inside rho0, else 0.  Eq. (18).
Eigen::Vector3d khatib_force(const scene::PlannerOptions& o, const Eigen::Vector3d& n, double d) noexcept;

/// How much of a gain's strength is let through, 0..1: 0 beyond rho0, when receding and at rest.
///   F1, F2, F3: 1/(1 + exp(d - rho0)), Eq. (20)
///   S:          S(1 - d/rho0) S(c/c0), c = n.v/|v|; planner.md 1.4
double gyro_gate(const scene::PlannerOptions& o, scene::GainForm form, const Eigen::Vector3d& n, double d,
                 const Eigen::Vector3d& v) noexcept;
/// The same of the method in use: 0 for attract, 1 within rho0 for khatib.
double gate(const scene::PlannerOptions& o, const Eigen::Vector3d& n, double d,
            const Eigen::Vector3d& v) noexcept;

/// The scalar k of w = k e; 0 beyond rho0, when receding and at rest.
///   F1, F2, F3: kobs G(phi) / d / (1 + exp(d - rho0)), Eq. (20); G = exp(phi)-1, exp(1/max(phi, phi_min)),
///                exp(phi-1)
///   S:           kobs (n.v) / d S(1 - d/rho0) S(c/c0), c = n.v/|v|; planner.md 1.4
double gyro_gain(const scene::PlannerOptions& o, scene::GainForm form, const Eigen::Vector3d& n, double d,
                 const Eigen::Vector3d& v) noexcept;

/// w = k (n x v)/|n x v|, Eqs. (19), (20).  Zero head on, where the paper's axis is not defined.
Eigen::Vector3d paper_rotation(const scene::PlannerOptions& o, const Eigen::Vector3d& n, double d,
                               const Eigen::Vector3d& v) noexcept;

/// e = normalize((n x v)/|v| + 0.2 max(0, 1 - |n x v|/(0.17 |v|)) preferred): the paper's axis, completed
/// near head-on by a preferred one (unit or zero).  Zero when both vanish.  planner.md 1.5.
Eigen::Vector3d turning_axis(const Eigen::Vector3d& n, const Eigen::Vector3d& v,
                             const Eigen::Vector3d& preferred) noexcept;

}  // namespace hamel::planner
