#include "common/base/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

namespace hamel {
namespace {

TEST(SplitMix64, DrawsThePublishedNumbers) {
  // Of seed 0: Vigna's splitmix64.c; of 1234567: Rosetta Code, "Pseudo-random numbers/Splitmix64".
  SplitMix64 zero(0);
  for (const std::uint64_t x : {0xe220a8397b1dcdafull, 0x6e789e6aa1b965f4ull, 0x06c45d188009454full,
                                0xf88bb8a8724c81ecull, 0x1b39896a51a8749bull})
    EXPECT_EQ(zero.next(), x);
  SplitMix64 other(1234567);
  for (const std::uint64_t x : {6457827717110365317ull, 3203168211198807973ull, 9817491932198370423ull,
                                4593380528125082431ull, 16408922859458223821ull})
    EXPECT_EQ(other.next(), x);
}

TEST(SplitMix64, DrawsFromItsInterval) {
  SplitMix64 rng(20261122);
  std::array<int, 10> tenths{};
  double least = 1, most = 0, sum = 0;
  constexpr int kDraws = 100000;
  for (int k = 0; k < kDraws; ++k) {
    const double u = rng.unit();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    ++tenths[static_cast<std::size_t>(10 * u)];
    const double x = rng.uniform(-3, 5);
    ASSERT_GE(x, -3);
    ASSERT_LT(x, 5);
    least = std::min(least, u), most = std::max(most, u), sum += x;
  }
  for (const int count : tenths) EXPECT_NEAR(count, kDraws / 10, 500);
  EXPECT_LT(least, 1e-3);
  EXPECT_GT(most, 1 - 1e-3);
  EXPECT_NEAR(sum / kDraws, 1, 0.05);
}

}  // namespace
}  // namespace hamel
