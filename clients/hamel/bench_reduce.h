#pragma once
/// `hamel bench reduce`: what modelling only what a scene requires buys, ticks alone.

namespace hamel::client {

struct BenchReduceArgs {
  bool json = false, check = false;
};

/// Planner cycles of the Panda among 1,000 obstacles of which 10 are in reach beside those 10 alone, standing
/// and with one that moves; its cycle at full fidelity beside 16 and 256 spheres; panda_reach reduced and at
/// its fastest beside full.  CPU time of one core, what is compared in turns.
/// @return 0; with `check` 1 where a promise is broken; 2 where panda_reach is not there
int bench_reduce(const BenchReduceArgs& args);

}  // namespace hamel::client
