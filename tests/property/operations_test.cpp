// Operations of the recursions, counted one by one: exactly linear in the number of joints.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "common/lie/sincos.h"

namespace hamel::test {

/// A number that counts what is done to it.
struct Counted {
  double v = 0;
  Counted() = default;
  Counted(double x) : v(x) {}
  static inline long operations = 0;
};
inline Counted counted(double v) {
  ++Counted::operations;
  return v;
}
inline Counted operator+(const Counted& a, const Counted& b) { return counted(a.v + b.v); }
inline Counted operator-(const Counted& a, const Counted& b) { return counted(a.v - b.v); }
inline Counted operator*(const Counted& a, const Counted& b) { return counted(a.v * b.v); }
inline Counted operator/(const Counted& a, const Counted& b) { return counted(a.v / b.v); }
inline Counted operator-(const Counted& a) { return counted(-a.v); }
inline Counted& operator+=(Counted& a, const Counted& b) { return a = a + b; }
inline Counted& operator-=(Counted& a, const Counted& b) { return a = a - b; }

}  // namespace hamel::test

namespace hamel::lie {
inline void sincos(const test::Counted& x, test::Counted& s, test::Counted& c) noexcept {
  ++test::Counted::operations;
  sincos(x.v, s.v, c.v);
}
}  // namespace hamel::lie

#include "common/rbd/sweeps.h"
#include "tests/support/chains.h"

namespace hamel::rbd {
namespace {

using test::Counted;

/// Of frames, inertias factorised, a solution and the torques of outer wrenches.
template <class G>
std::array<long, 4> operations(const model::Chain& model) {
  const typename G::Chain chain(model);
  const std::size_t n = static_cast<std::size_t>(chain.n());
  std::vector<typename G::template Frame<Counted>> X(n);
  std::vector<Factor<G, Counted>> factor(n);
  std::vector<typename G::template Motion<double>> push(n);
  std::vector<typename G::template Attitude<Counted>> R(n);
  std::vector<Counted> q(n, 0.3), b(n, 1.0), u(n), x(n);
  std::array<long, 4> count{};
  const auto tally = [&](std::size_t which, const auto& work) {
    Counted::operations = 0;
    work();
    count[which] = Counted::operations;
  };
  tally(0, [&] { place(chain, q.data(), X.data()); });
  tally(1, [&] { factorise<G, Counted>(chain, X.data(), nullptr, factor.data()); });
  tally(2, [&] { solve<G, Counted>(chain, X.data(), factor.data(), b.data(), u.data(), x.data()); });
  tally(3, [&] { wrench_torques<G, Counted>(chain, X.data(), push.data(), R.data(), x.data()); });
  return count;
}

template <class G>
void expect_linear() {
  const auto at = [](int n) { return operations<G>(test::checked(test::planar(n, 1, 1, 0.1))); };
  const auto ten = at(10), twenty = at(20), thousand = at(1000);
  for (std::size_t k = 0; k < ten.size(); ++k) {
    EXPECT_GT(ten[k], 0) << k;
    EXPECT_EQ(thousand[k] - twenty[k], 98 * (twenty[k] - ten[k])) << k;
  }
}

TEST(Operations, AreExactlyLinearInTheChain) {
  expect_linear<SE3>();
  expect_linear<SE2>();
}

}  // namespace
}  // namespace hamel::rbd
