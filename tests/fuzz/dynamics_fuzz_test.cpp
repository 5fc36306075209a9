// A bounded fuzz run with every test; the long one is libFuzzer's (dynamics_fuzz.cpp).
#include <gtest/gtest.h>

#include <vector>

#include "tests/fuzz/dynamics_case.h"
#include "tests/support/chains.h"
#include "tests/support/soak.h"

namespace hamel {
namespace {

TEST(Fuzz, NoModelAndNoStateLetsANanEscapeACrashOrAHang) {
  int built = 0;
  const unsigned cases = test::soak() ? 500000 : 20000;
  for (unsigned seed = 0; seed < cases; ++seed) {
    test::Random rng(seed);
    std::vector<std::uint8_t> data(static_cast<std::size_t>(rng.uniform(200, 1200)));
    for (std::uint8_t& b : data) b = static_cast<std::uint8_t>(rng.uniform(0, 256));
    ASSERT_EQ(fuzz::judge(data), "") << "seed " << seed;
    fuzz::Bytes in(data);
    fuzz::options(in);
    built += model::build(fuzz::spec(in)) ? 1 : 0;
  }
  EXPECT_GT(built, static_cast<int>(cases / 10)) << "too few inputs reach the integrators";
}

}  // namespace
}  // namespace hamel
