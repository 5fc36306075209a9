#pragma once
/// The loop of every process: poll its services until all are finished or a signal comes.

#include <chrono>
#include <span>

#include "common/bus/bus.h"
#include "common/runtime/signals.h"

namespace hamel::runtime {

using Clock = std::chrono::steady_clock;
inline Clock::duration seconds(double s) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
}

/// A service in its shell: it reads its topics, ticks, and writes its topics, on the caller's thread.
class Service {
 public:
  virtual ~Service() = default;
  /// Does what is due at `now`; true when anything was done.
  virtual bool poll(Clock::time_point now) = 0;
  /// When poll() must be called again even if nothing arrives.
  virtual Clock::time_point due() const = 0;
  /// True when there is nothing left to do.
  virtual bool finished() const = 0;
  /// What its end means for the process; asked when it has finished.
  virtual int exit_code() const { return 0; }
  /// How many readers its main topics have, the fewest of them.
  virtual int readers() const { return 0; }
  /// Says goodbye on the bus; called once, when the loop has ended.
  virtual void close() {}
};

/// Polls all services until `lead` is finished (true) or a stop was asked for (false); then closes them.
bool run(bus::Node& node, std::span<Service* const> services, const Service& lead, StopSignal& stop);

/// Waits until the service has so many readers and a moment more, so that they know it too: what it says
/// first would be lost on those that come later.  Gives up after five seconds, or when a stop is asked for.
void await_readers(bus::Node& node, const Service& service, int readers, StopSignal& stop);

/// Gives the middleware a moment to deliver the last words before the process ends.
void linger(bus::Node& node);

}  // namespace hamel::runtime
