#include "common/base/even.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace hamel {
namespace {

TEST(EvenPoints, GoOnByTheGoldenRatioOnALine) {
  const double golden = 0.5 * (1 + std::sqrt(5.0));
  for (int k = 0; k < 100; ++k) {
    double whole;
    EXPECT_NEAR(even_point(1, k)[0], std::modf(0.5 + k / golden, &whole), 1e-12) << k;
  }
}

// The plastic number, the root of x^3 = x + 1, to the digits that Roberts gives.
TEST(EvenPoints, GoOnByThePlasticNumberInTheSquare) {
  constexpr double kPlastic = 1.32471795724474602596;
  const std::vector<double> u = even_point(2, 1);
  EXPECT_NEAR(u[0], 1 / kPlastic - 0.5, 1e-12);
  EXPECT_NEAR(u[1], 0.5 + 1 / (kPlastic * kPlastic) - 1, 1e-12);
}

TEST(EvenPoints, LeaveNoGapsInAnyCoordinate) {
  for (const int n : {1, 2, 7, 30}) {
    std::vector<std::vector<double>> seen(static_cast<std::size_t>(n));
    for (int k = 0; k < 200; ++k) {
      const std::vector<double> u = even_point(n, k);
      for (std::size_t i = 0; i < u.size(); ++i) seen[i].push_back(u[i]);
    }
    for (std::vector<double>& x : seen) {
      std::sort(x.begin(), x.end());
      EXPECT_GE(x.front(), 0);
      EXPECT_LT(x.back(), 1);
      double gap = std::max(x.front(), 1 - x.back());
      for (std::size_t k = 1; k < x.size(); ++k) gap = std::max(gap, x[k] - x[k - 1]);
      EXPECT_LT(gap, 0.2) << n;
    }
  }
}

}  // namespace
}  // namespace hamel
