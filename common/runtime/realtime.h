#pragma once
/// Real-time scheduling on request: priority, locked memory, one processor; refused in words, never silently.

#include "common/base/result.h"

namespace hamel::runtime {

struct RealtimeOptions {
  int priority = 0;          ///< SCHED_FIFO, 1..99; 0: left alone
  bool lock_memory = false;  ///< mlockall, now and later
  int cpu = -1;              ///< the one processor to run on; < 0: any
};

/// Applies them to the calling thread and those it starts later.  Empty, or every refusal with the command
/// that mends it.
Problems go_realtime(const RealtimeOptions& o);

/// The calling thread under the ordinary scheduler, on any processor it could run on before go_realtime():
/// for threads beside the loop whose work takes long.
void go_ordinary() noexcept;

}  // namespace hamel::runtime
