// Stages four by four.  Compiled for AVX2 and called only where the processor has it.
#ifdef HAMEL_X86_LANES
#include "services/dynamics/core/gauss_stages.h"

namespace hamel::dynamics {
namespace {
struct Avx2 {};
}  // namespace

template <class G>
void stages_avx2(StageJob<G>& job) noexcept {
  if (job.padded == 2) return evaluate_stages<G, lie::Pack<2, Avx2>>(job);
  evaluate_stages<G, lie::Pack<4, Avx2>>(job);
}
template void stages_avx2<SE3>(StageJob<SE3>&) noexcept;
template void stages_avx2<SE2>(StageJob<SE2>&) noexcept;

}  // namespace hamel::dynamics
#endif
