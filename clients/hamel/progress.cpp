#include "clients/hamel/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "clients/hamel/timing.h"

namespace hamel::client {

namespace {

constexpr double kEach_s = 0.2;  // a line on a terminal
constexpr const char* kAnew = "\r\033[K";

}  // namespace

Progress::Progress(std::size_t of, std::string unit)
    : terminal_(isatty(STDERR_FILENO) == 1),
      of_(of),
      unit_(std::move(unit)),
      began_s_(now_s()),
      last_s_(began_s_) {}

Progress::~Progress() {
  if (terminal_ && shown_) fmt::print(stderr, "{}", kAnew);
}

void Progress::say(std::size_t done, const std::string& what) {
  const double now = now_s(), passed = now - began_s_;
  if (done < of_ && now - last_s_ < (terminal_ ? kEach_s : 10.0)) return;
  if (done == of_ && !shown_ && !terminal_) return;  // it was quick
  last_s_ = now;
  shown_ = true;
  const double rate = passed > 0 ? static_cast<double>(done) / passed : 0;
  const double left = rate > 0 ? static_cast<double>(of_ - done) / rate : 0;
  fmt::print(stderr, "{}{}/{} {}, {:.1f} a second, {:.0f} s to go{}{}{}", terminal_ ? kAnew : "", done, of_,
             unit_, rate, left, what.empty() ? "" : ": ", what, terminal_ ? "" : "\n");
  std::fflush(stderr);
}

Doing::Doing() : terminal_(isatty(STDERR_FILENO) == 1), last_s_(now_s()) {}

void Doing::say(const std::string& what) {
  if (what.empty() && shown_) fmt::print(stderr, "{}", kAnew);
  if (what.empty()) shown_ = false;
  if (what.empty() || !terminal_ || now_s() - last_s_ < kEach_s) return;
  last_s_ = now_s();
  shown_ = true;
  fmt::print(stderr, "{}{}", kAnew, what);
  std::fflush(stderr);
}

}  // namespace hamel::client
