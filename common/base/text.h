#pragma once
/// Numbers as text without a formatting library: for messages of hamel::core.

#include <charconv>
#include <string>

namespace hamel {

/// The shortest text that reads back as x; "nan" and "inf" as such.
inline std::string text(double x) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, x).ptr;
  return std::string(buffer, end);
}
inline std::string text(int x) { return std::to_string(x); }

}  // namespace hamel
