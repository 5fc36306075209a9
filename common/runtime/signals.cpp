#include "common/runtime/signals.h"

#include <pthread.h>
#include <signal.h>

namespace hamel::runtime {

namespace {
sigset_t stop_signals() {
  sigset_t s;
  sigemptyset(&s);
  sigaddset(&s, SIGINT);
  sigaddset(&s, SIGTERM);
  sigaddset(&s, SIGHUP);
  return s;
}
}  // namespace

StopSignal::StopSignal() {
  const sigset_t set = stop_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  thread_ = std::thread([this, set] {
    for (;;) {
      int which = 0;
      sigwait(&set, &which);
      if (ending_) return;
      signal_ = which;
      const std::lock_guard lock(mutex_);
      if (wake_) wake_();
    }
  });
}

StopSignal::~StopSignal() {
  ending_ = true;
  pthread_kill(thread_.native_handle(), SIGTERM);
  thread_.join();
}

void StopSignal::on_stop(std::function<void()> wake) {
  const std::lock_guard lock(mutex_);
  wake_ = std::move(wake);
  if (requested() && wake_) wake_();
}

}  // namespace hamel::runtime
