// libFuzzer's entry: tests/fuzz/run 300 wire_fuzz

#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/wire_case.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string broken = hamel::fuzz::judge_wire({data, size});
  if (broken.empty()) return 0;
  std::fprintf(stderr, "%s\n", broken.c_str());
  std::abort();
}
