// libFuzzer's entry:  cmake --preset fuzz && ninja -C build/fuzz dynamics_fuzz &&
// build/fuzz/tests/fuzz/dynamics_fuzz
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/dynamics_case.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string broken = hamel::fuzz::judge({data, size});
  if (broken.empty()) return 0;
  std::fprintf(stderr, "%s\n", broken.c_str());
  std::abort();
}
