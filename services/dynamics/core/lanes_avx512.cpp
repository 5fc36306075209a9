// Stages eight by eight.  Compiled for AVX-512 and called only where the processor has it.
#ifdef HAMEL_X86_LANES
#include "services/dynamics/core/gauss_stages.h"

namespace hamel::dynamics {
namespace {
struct Avx512 {};
}  // namespace

template <class G>
void stages_avx512(StageJob<G>& job) noexcept {
  if (job.padded == 2) return evaluate_stages<G, lie::Pack<2, Avx512>>(job);
  if (job.padded == 4) return evaluate_stages<G, lie::Pack<4, Avx512>>(job);
  evaluate_stages<G, lie::Pack<8, Avx512>>(job);
}
template void stages_avx512<SE3>(StageJob<SE3>&) noexcept;
template void stages_avx512<SE2>(StageJob<SE2>&) noexcept;

}  // namespace hamel::dynamics
#endif
