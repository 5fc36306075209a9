#pragma once
/// The loop of every process: poll its services until all are finished or a signal comes.

#include <chrono>
#include <span>

#include "common/bus/bus.h"
#include "common/runtime/signals.h"

namespace hamel::runtime {

using Clock = std::chrono::steady_clock;

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
  /// Says goodbye on the bus; called once, when the loop has ended.
  virtual void close() {}
};

/// Polls all services until `lead` is finished (true) or a stop was asked for (false); then closes them.
bool run(bus::Node& node, std::span<Service* const> services, const Service& lead, StopSignal& stop);

/// Gives the middleware a moment to deliver the last words before the process ends.
void linger(bus::Node& node);

}  // namespace hamel::runtime
