// Stages two by two, with what every x86-64 has; and the choice among the kernels.
#include "services/dynamics/core/gauss_stages.h"

namespace hamel::dynamics {

template <class G>
void stages_avx2(StageJob<G>& job) noexcept;
template <class G>
void stages_avx512(StageJob<G>& job) noexcept;

namespace {
template <class G>
void stages_baseline(StageJob<G>& job) noexcept {
  evaluate_stages<G, lie::Pack<2, lie::Baseline>>(job);
}
template <class T>
std::size_t room(int n) {
  return (8 * static_cast<std::size_t>(n) * sizeof(T) + 127) / 64 * 64;
}
}  // namespace

template <class G>
std::size_t scratch_bytes(int n) noexcept {
  return room<typename G::template Frame<double>>(n) + room<rbd::Factor<G, double>>(n) +
         2 * room<typename G::template Motion<double>>(n) + room<typename G::template Direction<double>>(n) +
         room<typename G::template Attitude<double>>(n) + 5 * room<double>(n);
}

#ifdef HAMEL_X86_LANES
Lanes widest_lanes() noexcept {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return Lanes::avx512;
  return __builtin_cpu_supports("avx2") ? Lanes::avx2 : Lanes::baseline;
}
template <class G>
StageKernel<G> stage_kernel(Lanes lanes) noexcept {
  if (lanes > widest_lanes()) return nullptr;
  return lanes == Lanes::avx512 ? &stages_avx512<G>
         : lanes == Lanes::avx2 ? &stages_avx2<G>
                                : &stages_baseline<G>;
}
#else
Lanes widest_lanes() noexcept { return Lanes::baseline; }
template <class G>
StageKernel<G> stage_kernel(Lanes lanes) noexcept {
  return lanes == Lanes::baseline ? &stages_baseline<G> : nullptr;
}
#endif

template std::size_t scratch_bytes<SE3>(int) noexcept;
template std::size_t scratch_bytes<SE2>(int) noexcept;
template StageKernel<SE3> stage_kernel<SE3>(Lanes) noexcept;
template StageKernel<SE2> stage_kernel<SE2>(Lanes) noexcept;

}  // namespace hamel::dynamics
