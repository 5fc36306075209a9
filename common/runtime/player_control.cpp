#include "common/runtime/player_control.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

namespace hamel::runtime {

PlayerControl::PlayerControl(bool on) : on_(on) {
  if (!on_ || isatty(STDIN_FILENO) == 0) return;
  termios mode{};
  on_ = tcgetpgrp(STDIN_FILENO) == getpgrp() && tcgetattr(STDIN_FILENO, &mode) == 0;
  if (!on_) return;
  before_ = mode;
  mode.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  tcsetattr(STDIN_FILENO, TCSANOW, &mode);
  fmt::print(stderr, "space: pause or go on   .: one step   q: end\n");
}

PlayerControl::~PlayerControl() {
  if (before_) tcsetattr(STDIN_FILENO, TCSANOW, &*before_);
}

std::optional<PlayerCommand> PlayerControl::next() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  while (on_ && ::poll(&input, 1, 0) == 1) {
    char block[256];
    const ssize_t n = ::read(STDIN_FILENO, block, sizeof block);
    if (n <= 0) on_ = false;
    if (n > 0) waiting_.append(block, static_cast<std::size_t>(n));
  }
  while (!waiting_.empty()) {
    const auto size = waiting_.size();
    if (const auto command = before_ ? take_key() : take_line()) return command;
    if (waiting_.size() == size) break;
  }
  return {};
}

std::optional<PlayerCommand> PlayerControl::take_key() {
  const char key = waiting_.front();
  waiting_.erase(0, 1);
  if (key == ' ') return PlayerCommand::toggle;
  if (key == '.') return PlayerCommand::step;
  if (key == 'q') return PlayerCommand::quit;
  return {};
}

std::optional<PlayerCommand> PlayerControl::take_line() {
  const auto end = waiting_.find('\n');
  if (end == std::string::npos) return {};
  const std::string word = waiting_.substr(0, end);
  waiting_.erase(0, end + 1);
  if (word == "pause") return PlayerCommand::pause;
  if (word == "resume") return PlayerCommand::resume;
  if (word == "step") return PlayerCommand::step;
  if (word == "quit") return PlayerCommand::quit;
  if (!word.empty()) fmt::print(stderr, "\"{}\" is no command; pause, resume, step or quit\n", word);
  return {};
}

}  // namespace hamel::runtime
