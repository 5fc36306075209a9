#pragma once
/// Commands to something that plays, from a terminal or a script.

#include <termios.h>

#include <optional>
#include <string>

namespace hamel::runtime {

enum class PlayerCommand { pause, resume, toggle, step, quit };

/// Reads standard input without waiting.  A terminal gives keys: space pauses and goes on, `.` makes one
/// step, q ends.  Anything else gives lines: pause, resume, step, quit; other words are complained about on
/// stderr. Without anybody at the other end (closed, or a terminal of another job) there are no commands.
class PlayerControl {
 public:
  /// `on` false: no commands ever.  Puts a terminal into a mode that gives single keys; the destructor undoes
  /// it.
  explicit PlayerControl(bool on);
  ~PlayerControl();
  PlayerControl(const PlayerControl&) = delete;
  PlayerControl& operator=(const PlayerControl&) = delete;
  std::optional<PlayerCommand> next();

 private:
  std::optional<PlayerCommand> take_key();
  std::optional<PlayerCommand> take_line();
  bool on_;
  std::optional<termios> before_;  ///< the terminal's mode; none: no terminal
  std::string waiting_;
};

}  // namespace hamel::runtime
