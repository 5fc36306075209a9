#pragma once
/// The stages of a Gauss step evaluated side by side in the lanes of SIMD registers.
///
/// One kernel a set of instructions, each in a file compiled for it (lanes_*.cpp), chosen at run time: one
/// binary for every x86-64 uses the widest its processor has.  All give the same bits.

#include <cstddef>
#include <cstdint>

#include "services/dynamics/core/tier.h"

namespace hamel::dynamics {

/// Instructions that a kernel uses: two, four, eight lanes.
enum class Lanes : std::uint8_t { baseline, avx2, avx512 };

/// One evaluation of all stages.  Matrices are laid out joint by joint: stage j of joint i at [i * padded +
/// j]; rows from `stages` to `padded` (2, 4 or 8) repeat the last stage.
template <class G>
struct StageJob {
  const typename G::Chain* chain = nullptr;
  const Load<G>* load = nullptr;
  const double* tau = nullptr;
  double h = 0, stop_stiffness = 0;
  int stages = 0, padded = 0;
  const double* a = nullptr;  ///< a_ij at [j * padded + i]
  const double *q = nullptr, *p = nullptr;
  const double* inertia = nullptr;      ///< what turns a joint's rate into momentum
  double* scale_inv = nullptr;          ///< 1 / what a mismatch is measured by
  bool rescale = true;                  ///< make it, once a step
  const double* past = nullptr;         ///< V, then F at the last step's stages, unpadded; null: none
  const double* extrapolate = nullptr;  ///< E_ij at [j * padded + i]: V and F carry `past` on
  double *V = nullptr, *F = nullptr;
  double *V_next = nullptr, *F_next = nullptr;
  double* applied = nullptr;  ///< torque, damping, stops, wrenches: what does work
  void* scratch = nullptr;
  double torque_Nm = 0, relative = 0;  ///< result: Residual
};
/// Bytes of scratch for n joints.
template <class G>
std::size_t scratch_bytes(int n) noexcept;
template <class G>
using StageKernel = void (*)(StageJob<G>& job) noexcept;

/// The widest this processor has.
Lanes widest_lanes() noexcept;
/// Null where this build has no such kernel.
template <class G>
StageKernel<G> stage_kernel(Lanes lanes) noexcept;

}  // namespace hamel::dynamics
