#pragma once
/// What measurements of time here stand on.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

namespace hamel::client {

/// Of the clock that never goes back, from some origin.
inline double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// The value that `part` of them lie below; 0 of none.  Sorts v.
inline double quantile(std::vector<double>& v, double part) {
  if (v.empty()) return 0;
  std::sort(v.begin(), v.end());
  return v[std::min(v.size() - 1, static_cast<std::size_t>(part * static_cast<double>(v.size())))];
}

}  // namespace hamel::client
