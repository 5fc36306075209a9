#pragma once
/// Says "ready" and "alive" to systemd (Type=notify, WatchdogSec=), by the socket it names; without one
/// nothing.

#include "common/runtime/loop.h"

namespace hamel::runtime {

class SystemdNotifier final : public Service {
 public:
  /// Reads NOTIFY_SOCKET and WATCHDOG_USEC.
  SystemdNotifier();
  ~SystemdNotifier() override;
  SystemdNotifier(const SystemdNotifier&) = delete;
  SystemdNotifier& operator=(const SystemdNotifier&) = delete;
  /// READY=1 with the first poll, then WATCHDOG=1 twice in each period of the watchdog.
  bool poll(Clock::time_point now) override;
  Clock::time_point due() const override { return next_; }
  bool finished() const override { return false; }
  void close() override { say("STOPPING=1"); }

 private:
  void say(const char* what) const noexcept;
  int socket_ = -1;
  bool ready_ = false;
  Clock::duration period_{};
  Clock::time_point next_ = Clock::time_point::max();
};

}  // namespace hamel::runtime
