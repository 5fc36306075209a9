#pragma once
/// Whether the long ones run: tests/run --soak sets HAMEL_SOAK=1.  Never under sanitizers: they would take
/// hours.

#include <cstdlib>
#include <string>

namespace hamel::test {

inline bool soak() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return false;
#else
  const char* said = std::getenv("HAMEL_SOAK");
  return said != nullptr && std::string(said) == "1";
#endif
}

}  // namespace hamel::test
