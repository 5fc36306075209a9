// A bounded fuzz run with every test; the long one is libFuzzer's (dynamics_fuzz.cpp).
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/fuzz/dynamics_case.h"
#include "tests/support/chains.h"
#include "tests/support/soak.h"

namespace hamel {
namespace {

TEST(Fuzz, NoModelAndNoStateLetsANanEscapeACrashOrAHang) {
  int built = 0, planar = 0, longest = 0;
  const unsigned cases = test::soak() ? 100000 : 8000;
  for (unsigned seed = 0; seed < cases; ++seed) {
    test::Random rng(seed);
    std::vector<std::uint8_t> data(static_cast<std::size_t>(rng.uniform(200, 4000)));
    for (std::uint8_t& b : data) b = static_cast<std::uint8_t>(rng.uniform(0, 256));
    ASSERT_EQ(fuzz::judge(data), "") << "seed " << seed;
    fuzz::Bytes in(data);
    fuzz::options(in);
    const auto chain = model::build(fuzz::spec(in));
    if (!chain) continue;
    ++built;
    planar += rbd::is_planar(chain.value()) && chain.value().n() > 1;
    longest = std::max(longest, chain.value().n());
  }
  EXPECT_GT(built, static_cast<int>(cases / 10)) << "too few inputs reach the integrators";
  EXPECT_GT(planar, static_cast<int>(cases / 50));
  EXPECT_EQ(longest, 40);
}

}  // namespace
}  // namespace hamel
