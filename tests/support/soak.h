#pragma once
/// Whether the long ones run: tests/run --soak sets HAMEL_SOAK=1.

#include <cstdlib>
#include <string>

namespace hamel::test {

inline bool soak() {
  const char* said = std::getenv("HAMEL_SOAK");
  return said != nullptr && std::string(said) == "1";
}

}  // namespace hamel::test
