#pragma once
/// A hash that is the same on every machine and in every build.

#include <cstdint>
#include <string_view>

namespace hamel {

inline constexpr std::uint64_t kHashStart = 1469598103934665603ull;

/// Goes on from h over the bytes of `text`, as FNV-1a does.
constexpr std::uint64_t hashed(std::string_view text, std::uint64_t h = kHashStart) noexcept {
  for (const char c : text) h = (h ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return h;
}

}  // namespace hamel
