// Our dynamics against four other libraries, each told the same numbers through its own API.
// Tolerance: 1e-10 of the norm; where M is inverted, times its condition.
#include <gtest/gtest.h>

#include "common/files/urdf.h"
#include "tests/peers/compare.h"
#include "tests/support/chains.h"
#include "tests/support/data.h"

namespace hamel::peers {
namespace {

constexpr double kTolerance = 1e-10;
constexpr unsigned kChains = 200;

/// What the peer can be told of `spec`: no damping, and no rotors where it knows none.
model::Chain known_to(const Peer& peer, model::ChainSpec spec) {
  for (model::Joint& joint : spec.joints)
    if (!peer.has_armature()) joint.armature = 0;
  return test::checked(std::move(spec));
}

class Peers : public testing::TestWithParam<Maker> {
 protected:
  void compare_at(const model::ChainSpec& spec, unsigned seed, int states) {
    const auto bare = GetParam().make(test::checked(spec));
    const model::Chain chain = known_to(*bare, spec);
    const auto peer = GetParam().make(chain);
    test::Random rng(seed);
    for (int k = 0; k < states; ++k) compare(*peer, chain, rng, kTolerance);
  }
};
INSTANTIATE_TEST_SUITE_P(Agreement, Peers, testing::ValuesIn(makers()),
                         [](const auto& peer) { return peer.param.name; });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Peers);

TEST_P(Peers, AgreeOnRandomChains) {
  for (unsigned seed = 0; seed < kChains; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    test::Random rng(seed);
    const model::ChainSpec spec = test::random_spec(rng, 1 + static_cast<int>(seed % 10), {.damping = 0.3});
    compare_at(spec, seed + 1000, 3);
    if (HasFailure()) return;
  }
}

TEST_P(Peers, AgreeOnTheExamplesOfThePaper) {
  compare_at(test::paper_5_1().spec(), 1, 20);
  compare_at(test::paper_5_2().spec(), 2, 20);
}

TEST_P(Peers, AgreeOnRobotsOfTheWorld) {
  HAMEL_NEEDS_DATA("urdf");
  for (const std::string& file : test::files_in(test::data_folder() / "urdf", ".urdf")) {
    SCOPED_TRACE(file);
    const auto robot = files::load_urdf(file);
    ASSERT_TRUE(robot) << to_string(robot.error().front());
    compare_at(robot.value().chain.spec(), 7, 20);
  }
}

}  // namespace
}  // namespace hamel::peers
