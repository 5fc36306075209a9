#pragma once
/// How large the parts are that a discrete momentum is summed from: a residual is rounding, not error, when it is
/// small against them.  The sum itself is no measure: it vanishes where the parts cancel, as at a joint that
/// carries no torque when an arm is set in motion from rest.

#include <algorithm>
#include <cmath>

#include "common/rbd/sweeps.h"

namespace hamel::dynamics {

inline double norm1(const lie::Vec3<double>& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }

/// Bounds of the angular and linear parts of a composite momentum, gathered from the tip as the momentum is.
struct MomentumParts {
  double angular = 0, linear = 0;   ///< [kg m^2/s], [kg m/s]
  /// Adds a link that moves with twist V.
  void add(const rbd::AxisLink& k, const rbd::Half6<double>& V) {
    const double w = norm1(V.a), v = norm1(V.l), moment = norm1(k.h);
    angular += std::max({k.I_o.xx, k.I_o.yy, k.I_o.zz}) * w + moment * v;
    linear += k.mass * v + moment * w;
  }
  /// Moves the point of reference by p.
  void shift(const lie::Vec3<double>& p) { angular += norm1(p) * linear; }
  double along(const rbd::AxisLink& k) const { return k.prismatic ? linear : angular; }
};

}  // namespace hamel::dynamics
