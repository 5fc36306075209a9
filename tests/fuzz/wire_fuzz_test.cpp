// A bounded fuzz run over the wire with every test; the long one is libFuzzer's (wire_fuzz.cpp).
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "tests/fuzz/wire_case.h"
#include "tests/integration/random_messages.h"
#include "tests/support/soak.h"

namespace hamel {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class T>
Bytes seed_of(test::Random& random, std::uint8_t kind) {
  T m;
  test::randomise(random, m);
  bus::Payload p;
  wire::encode(m, p);
  Bytes out{kind};
  for (const std::byte b : p) out.push_back(std::to_integer<std::uint8_t>(b));
  return out;
}

/// Valid messages of every kind.
std::vector<Bytes> corpus() {
  std::vector<Bytes> all;
  test::Random random(5);
  for (int i = 0; i < 20; ++i) {
    all.push_back(seed_of<wire::ArmState>(random, 0));
    all.push_back(seed_of<wire::TorqueCommand>(random, 1));
    all.push_back(seed_of<wire::Goal>(random, 2));
    all.push_back(seed_of<wire::ObstacleSet>(random, 3));
    all.push_back(seed_of<wire::PlannerReport>(random, 4));
    all.push_back(seed_of<wire::ModeCommand>(random, 5));
    all.push_back(seed_of<wire::ServiceStatus>(random, 6));
    all.push_back(seed_of<wire::RobotDescription>(random, 7));
    all.push_back(seed_of<wire::SimulationClock>(random, 8));
    all.push_back(seed_of<wire::RunSummary>(random, 9));
  }
  return all;
}

/// Bits flipped, bytes set, parts cut, doubled or taken from another message.
void mutate(test::Random& random, Bytes& data, const Bytes& other) {
  for (std::size_t n = 1 + random.below(4); n > 0 && data.size() > 1; --n) {
    const std::size_t at = 1 + random.below(std::min<std::size_t>(data.size() - 1, 600));
    switch (random.below(5)) {
      case 0:
        data[at] ^= static_cast<std::uint8_t>(1u << random.below(8));
        break;
      case 1:
        data[at] = random.coin() ? 0xff : 0;
        break;
      case 2:
        data.resize(at);
        break;
      case 3:
        data.insert(data.end(), data.begin() + 1, data.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      default:
        for (std::size_t i = at; i < std::min({data.size(), other.size(), at + 8}); ++i) data[i] = other[i];
    }
  }
}

TEST(WireFuzz, WhateverAStrangerSendsIsRefusedOrUnderstoodTheSameWayTwice) {
  const auto seeds = corpus();
  for (const Bytes& seed : seeds) ASSERT_EQ(fuzz::judge_wire(seed), "");
  test::Random random(6);
  const int cases = test::soak() ? 2000000 : 40000;
  for (int i = 0; i < cases; ++i) {
    Bytes data = seeds[random.below(seeds.size())];
    mutate(random, data, seeds[random.below(seeds.size())]);
    ASSERT_EQ(fuzz::judge_wire(data), "") << "case " << i;
  }
}

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--corpus") {
    std::filesystem::create_directories(argv[2]);
    int n = 0;
    for (const auto& seed : hamel::corpus())
      std::ofstream(std::string(argv[2]) + "/seed" + std::to_string(n++), std::ios::binary)
          .write(reinterpret_cast<const char*>(seed.data()), static_cast<std::streamsize>(seed.size()));
    return 0;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
