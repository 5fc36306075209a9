/// The wire is the IDL's and nobody's own: three serialisers agree on every byte, and peers written with the
/// vendors' own tools understand us and are understood.

#include "tests/integration/foreign.h"

#include <gtest/gtest.h>

#include "common/wire/codec.h"
#include "tests/integration/golden.h"
#include "tests/integration/random_messages.h"

namespace hamel {
namespace {

using bus::Payload;
using bus::Vendor;
using namespace std::chrono_literals;

template <class T>
class Foreign : public testing::Test {
 protected:
  const Topic& topic() { return wire::topic_of<T>(); }
  Payload golden() {
    T m;
    test::golden(m);
    Payload p;
    EXPECT_TRUE(wire::encode(m, p));
    return p;
  }
};
using Messages = testing::Types<wire::ArmState, wire::TorqueCommand, wire::Goal, wire::ObstacleSet,
                                wire::PlannerReport, wire::ModeCommand, wire::ServiceStatus,
                                wire::RobotDescription, wire::SimulationClock, wire::RunSummary>;
TYPED_TEST_SUITE(Foreign, Messages);

/// The fields alone: without the header's options and the padding behind, which vendors treat differently.
Payload body(std::span<const std::byte> payload, std::size_t size) {
  EXPECT_GE(payload.size(), size);
  EXPECT_LT(payload.size(), size + 4);
  return payload.size() < size ? Payload()
                               : Payload(payload.begin() + 4, payload.begin() + static_cast<long>(size));
}
std::size_t unpadded(const Payload& ours) { return ours.size() - std::to_integer<std::size_t>(ours[3]); }

TYPED_TEST(Foreign, FastddsgenSerialisesTheGoldenSampleToTheSameBytes) {
  const Payload ours = this->golden(), theirs = test::fast_golden(this->topic());
  EXPECT_EQ(body(theirs, unpadded(ours)), body(ours, unpadded(ours)));
}

TYPED_TEST(Foreign, FastddsgenReadsAndWritesEveryMessageOfOursUnchanged) {
  test::Random random(5150);
  for (int i = 0; i < 200; ++i) {
    TypeParam m;
    test::randomise(random, m);
    Payload ours;
    ASSERT_TRUE(wire::encode(m, ours));
    const Payload theirs = test::fast_again(this->topic(), ours);
    ASSERT_EQ(body(theirs, unpadded(ours)), body(ours, unpadded(ours))) << "message " << i;
  }
}

template <class Condition>
bool eventually(bus::Node& node, Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + 20s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    node.wait(std::chrono::steady_clock::now() + 5ms);
  }
  return true;
}

void talk_with(test::ForeignPeer& peer, const Topic& topic, Vendor vendor, unsigned domain,
               const Payload& golden) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = domain;
  options.log = [](const std::string& line) { ADD_FAILURE() << line; };
  auto node = bus::open(options);
  ASSERT_TRUE(node) << to_string(node.error());
  bus::Node& here = *node.value();
  Topic echo_topic = topic;
  echo_topic.name = test::kEcho;
  const auto writer = here.writer(topic);
  const auto reader = here.reader(topic), echo = here.reader(echo_topic);
  ASSERT_TRUE(
      eventually(here, [&] { return peer.matched() && writer->matched() == 2 && echo->matched() == 1; }));
  Payload p;
  ASSERT_TRUE(peer.write_golden());
  ASSERT_TRUE(eventually(here, [&] { return reader->take(p); })) << "what the peer wrote";
  EXPECT_EQ(body(p, unpadded(golden)), body(golden, unpadded(golden)));
  ASSERT_TRUE(eventually(here, [&] { return peer.echo(); })) << "the peer reads itself";
  ASSERT_TRUE(eventually(here, [&] { return echo->take(p); }));

  Payload other = golden;  // another instance
  other[4] ^= std::byte{topic.type == "hamel::v1::ServiceStatus" ? std::uint8_t{0} : std::uint8_t{64}};
  ASSERT_TRUE(writer->write(other));
  ASSERT_TRUE(eventually(here, [&] { return peer.echo(); })) << "what we wrote";
  ASSERT_TRUE(eventually(here, [&] { return echo->take(p); }));
  EXPECT_EQ(body(p, unpadded(golden)), body(other, unpadded(golden)));
}

constexpr unsigned domain_of(const Topic& topic, unsigned first) {
  for (unsigned i = 0; i < kTopics.size(); ++i)
    if (kTopics[i].name == topic.name) return first + i;
  return first;
}

TYPED_TEST(Foreign, IdlcsPeerAndOurFastDdsUnderstandEachOther) {
  const unsigned domain = domain_of(this->topic(), 60);
  const auto peer = test::cyclone_peer(this->topic(), domain);
  talk_with(*peer, this->topic(), Vendor::fastdds, domain, this->golden());
}

TYPED_TEST(Foreign, FastddsgensPeerAndOurCycloneUnderstandEachOther) {
  const unsigned domain = domain_of(this->topic(), 70);
  const auto peer = test::fast_peer(this->topic(), domain);
  talk_with(*peer, this->topic(), Vendor::cyclonedds, domain, this->golden());
}

}  // namespace
}  // namespace hamel
