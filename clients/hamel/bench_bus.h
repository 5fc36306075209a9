#pragma once
/// `hamel bench bus`: what the bus costs, beside bare UDP in the same run.

#include <string>

#include "common/runtime/options.h"

namespace hamel::client {

struct BenchBusArgs {
  int samples = 5000;
  double rate_hz = 1000;
  std::uint32_t domain = 99;
  bool json = false, check = false;
  std::string only;    ///< latency, restart, loop or lockstep; empty: all of them
  int cpu = -1;        ///< all processes on this processor; < 0: any
  std::string answer;  ///< not for users: be the other process, over this vendor
};

/// Times of one way and round trip: bare UDP, inproc, each vendor and both mixed pairs, in one process and in
/// two; recovery after kill -9; lateness of a 1 kHz loop beside a busy process; lockstep steps a second. With
/// `check` 1 where a sample was lost, a restarted process was not back within a second (between vendors:
/// two), or lockstep is slower than half of what UDP's round trip would allow.
int bench_bus(const BenchBusArgs& args);

}  // namespace hamel::client
