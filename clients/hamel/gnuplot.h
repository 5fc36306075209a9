#pragma once
/// Pictures through gnuplot.

#include <fmt/format.h>

#include <optional>
#include <string>

#include "common/base/result.h"

namespace hamel::client {

/// A gnuplot script under construction.
class Script {
 public:
  template <class... A>
  void add(fmt::format_string<A...> f, A&&... a) {
    fmt::format_to(std::back_inserter(text_), f, std::forward<A>(a)...);
  }
  std::string str() const { return fmt::to_string(text_); }

 private:
  fmt::memory_buffer text_;
};

/// A problem unless `path` ends in .svg or .png.
std::optional<Problem> check_picture_name(const std::string& path);
/// As gnuplot takes it: in single quotes, those inside doubled.
std::string quoted(const std::string& text);
/// "set terminal" and "set output" for `path`.
std::string terminal(const std::string& path, int width, int height);
/// Runs gnuplot on `script`, which draws into `path`.
std::optional<Problem> draw(const std::string& script, const std::string& path);

}  // namespace hamel::client
