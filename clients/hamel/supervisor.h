#pragma once
/// Keeps child processes running: starts them, starts them again when they die, ends them all.

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace hamel::client {

class Supervisor {
 public:
  using Clock = std::chrono::steady_clock;
  struct Child {
    std::string name;
    std::vector<std::string> command;
    pid_t pid = -1;  ///< -1: not running
    int restarts = 0;
    int quick_deaths = 0;         ///< in a row, each within two seconds of its start
    bool ends_by_itself = false;  ///< its end with 0, 1 or 3 is the end of its job
    bool given_up = false;
    bool done = false;  ///< ended as it should, or given up
    int exit_code = 0;  ///< of its last end; 128 + signal for a signal
    Clock::time_point started{}, restart_at{};
  };

  ~Supervisor() { end(); }
  void add(std::string name, std::vector<std::string> command, bool ends_by_itself);
  /// Starts what should run, notes what died; a child that ended with 0 is done, one with 2 (bad input) or
  /// that died ten times within two seconds of its start is given up.  Logs each event.
  void poll(Clock::time_point now);
  /// SIGTERM to all, SIGKILL to those that are still there after 1.5 s.
  void end();

  /// True when the child that ends by itself has.
  bool ended() const;
  int restarts() const;
  /// The first child that was given up, if any.
  const Child* failed() const;
  const std::vector<Child>& children() const { return children_; }

 private:
  void start(Child& c, Clock::time_point now);
  void died(Child& c, int status, Clock::time_point now);
  std::vector<Child> children_;
};

}  // namespace hamel::client
