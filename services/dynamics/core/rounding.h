#pragma once
/// How large the parts are that a discrete momentum is summed from: a residual is rounding, not error, when
/// it is small against them.  The sum itself is no measure: it vanishes where the parts cancel, as at a joint
/// that carries no torque when an arm is set in motion from rest.

#include <cmath>

#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

/// A momentum [kg m^2/s] or energy [J] that is nothing: an arm that comes to rest under a brake passes
/// through it on its way to the denormal numbers, where no relative measure holds.
inline constexpr double kNothing = 1e-120;

/// Share of gravity's impulse on the whole arm that is nothing at any joint: an arm that is held still moves
/// by the rounding of the torque that holds it, also at joints on which gravity has no lever.
inline constexpr double kQuiet = 1e-10;

inline double norm1(const lie::Vec3<double>& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }
inline double norm1(const lie::Vec2<double>& v) { return std::abs(v.x) + std::abs(v.y); }
inline double norm1(double v) { return std::abs(v); }

/// Bounds of the angular and linear parts of a composite momentum, gathered from the tip as the momentum is.
struct MomentumParts {
  double angular = 0, linear = 0;  ///< [kg m^2/s], [kg m/s]
  /// Adds a link that moves with twist V.
  template <class Motion>
  void add(const rbd::JointNumbers& k, const Motion& V) {
    const double w = norm1(V.a), v = norm1(V.l);
    angular += k.inertia_size * w + k.moment_size * v;
    linear += k.mass * v + k.moment_size * w;
  }
  /// Moves the point of reference by p.
  template <class Vector>
  void shift(const Vector& p) {
    angular += norm1(p) * linear;
  }
  double along(const rbd::JointNumbers& k) const { return k.prismatic ? linear : angular; }
};

}  // namespace hamel::dynamics
