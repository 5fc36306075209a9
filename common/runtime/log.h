#pragma once
/// One line a thing that happened, to stderr, with the service's name; never from a hot path.

#include <spdlog/spdlog.h>

#include <chrono>
#include <string>

namespace hamel::runtime {

/// Names the log after the program; NO_COLOR and non-terminals get plain text.
void start_log(const std::string& name, bool verbose);

/// Lets a line through at most once a second and counts what it kept back.
class RateLimit {
 public:
  bool operator()(std::chrono::steady_clock::time_point now) {
    if (now - last_ < std::chrono::seconds(1)) {
      ++kept_back_;
      return false;
    }
    last_ = now;
    return true;
  }
  std::uint64_t kept_back() const { return kept_back_; }

 private:
  std::chrono::steady_clock::time_point last_{};
  std::uint64_t kept_back_ = 0;
};

}  // namespace hamel::runtime
