// libFuzzer's entry:  cmake --preset fuzz && ninja -C build/fuzz wire_fuzz && build/fuzz/tests/fuzz/wire_fuzz
// CORPUS A corpus to begin with: build/release/tests/fuzz/wire_fuzz_test --corpus CORPUS
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/wire_case.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string broken = hamel::fuzz::judge_wire({data, size});
  if (broken.empty()) return 0;
  std::fprintf(stderr, "%s\n", broken.c_str());
  std::abort();
}
