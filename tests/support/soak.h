#pragma once
/// Whether the long ones run: tests/run --soak sets HAMEL_SOAK=1.  Never under sanitizers: they would take
/// hours.

#include <cstdlib>
#include <string>

namespace hamel::test {

/// Sanitizers make everything ten to forty times as slow: samples are smaller under them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

inline bool soak() {
  const char* said = kSanitized ? nullptr : std::getenv("HAMEL_SOAK");
  return said != nullptr && std::string(said) == "1";
}

}  // namespace hamel::test
