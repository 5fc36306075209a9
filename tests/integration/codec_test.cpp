/// The codec's laws: what was encoded decodes to the same, and nothing a stranger sends does harm.

#include "common/wire/codec.h"

#include <gtest/gtest.h>

#include <chrono>

#include "tests/integration/random_messages.h"

namespace hamel {
namespace {

using bus::Payload;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class T>
class EveryMessage : public testing::Test {};
using Messages = testing::Types<wire::ArmState, wire::TorqueCommand, wire::Goal, wire::ObstacleSet,
                                wire::PlannerReport, wire::ModeCommand, wire::ServiceStatus,
                                wire::RobotDescription, wire::SimulationClock, wire::RunSummary>;
TYPED_TEST_SUITE(EveryMessage, Messages);

template <class T>
T random_message(test::Random& random) {
  T m;
  test::randomise(random, m);
  return m;
}

template <class T>
Payload encoded(const T& m) {
  Payload payload;
  EXPECT_TRUE(wire::encode(m, payload));
  return payload;
}

TYPED_TEST(EveryMessage, DecodesToWhatWasEncoded) {
  test::Random random(20240711);
  TypeParam back;  // reused: nothing of the last message may shine through
  for (int i = 0; i < 200; ++i) {
    const auto m = random_message<TypeParam>(random);
    const Payload payload = encoded(m);
    const auto result = wire::decode<TypeParam>(payload, back);
    ASSERT_TRUE(result) << result.error().field << " " << result.error().rule;
    if constexpr (std::is_same_v<TypeParam, wire::ObstacleSet>) {  // a rotation goes through a quaternion
      ASSERT_EQ(back.obstacles.size(), m.obstacles.size());
      for (std::size_t k = 0; k < m.obstacles.size(); ++k) {
        ASSERT_LE((back.obstacles[k].X_WO.R - m.obstacles[k].X_WO.R).norm(), 4e-15);
        back.obstacles[k].X_WO.R = m.obstacles[k].X_WO.R;
      }
    }
    if constexpr (std::is_same_v<TypeParam, wire::Goal>) {
      ASSERT_LE((back.orientation_xyzw - m.orientation_xyzw).norm(), 4e-16);
      back.orientation_xyzw = m.orientation_xyzw;
    }
    ASSERT_EQ(encoded(back), payload) << "message " << i;
  }
}

TYPED_TEST(EveryMessage, IsPaddedToFourBytesThatSaySo) {
  test::Random random(77);
  for (int i = 0; i < 50; ++i) {
    const Payload payload = encoded(random_message<TypeParam>(random));
    EXPECT_EQ(payload.size() % 4, 0U);
    const auto padding = std::to_integer<std::size_t>(payload[3]);
    ASSERT_LE(padding, 3U);
    for (std::size_t k = payload.size() - padding; k < payload.size(); ++k)
      EXPECT_EQ(payload[k], std::byte{0});
  }
}

TYPED_TEST(EveryMessage, SameMessageSameBytesWhateverTheBufferHeld) {
  test::Random random(78);
  Payload dirty(5000, std::byte{0xa5});
  for (int i = 0; i < 50; ++i) {
    const auto m = random_message<TypeParam>(random);
    ASSERT_TRUE(wire::encode(m, dirty));
    ASSERT_EQ(dirty, encoded(m));
    std::fill(dirty.begin(), dirty.end(), std::byte{0xa5});
  }
}

TYPED_TEST(EveryMessage, RefusesEveryTruncation) {
  test::Random random(79);
  const Payload whole = encoded(random_message<TypeParam>(random));
  const std::size_t end = whole.size() - std::to_integer<std::size_t>(whole[3]);
  TypeParam back;
  for (std::size_t n = 0; n < end; ++n)
    ASSERT_FALSE(wire::decode<TypeParam>(std::span(whole).first(n), back)) << n << " of " << end << " bytes";
}

TYPED_TEST(EveryMessage, RefusesTrailingBytesUnknownEncapsulationAndExcess) {
  TypeParam m, back;
  Payload payload = encoded(m);
  payload.resize(payload.size() + 4);
  EXPECT_FALSE(wire::decode<TypeParam>(payload, back));
  for (unsigned kind : {2U, 3U, 6U, 7U, 0x100U, 0xffffU}) {
    Payload other = encoded(m);
    other[0] = static_cast<std::byte>(kind >> 8), other[1] = static_cast<std::byte>(kind);
    const auto result = wire::decode<TypeParam>(other, back);
    ASSERT_FALSE(result);
    EXPECT_STREQ(result.error().field, "encapsulation");
  }
  const Payload huge(wire::topic_of<TypeParam>().max_bytes + 1);
  EXPECT_FALSE(wire::decode<TypeParam>(huge, back));
}

/// Random bytes, and valid messages with bits flipped, pieces cut and words overwritten: an answer each, and
/// what is accepted can be encoded again.  1e5 inputs over the ten types.
TYPED_TEST(EveryMessage, SurvivesWhatAStrangerSends) {
  const auto began = std::chrono::steady_clock::now();
  test::Random random(424242);
  TypeParam back;
  Payload valid, again;
  int accepted = 0;
  for (int i = 0; i < 10000; ++i) {
    if (i % 50 == 0) valid = encoded(random_message<TypeParam>(random));
    Payload bytes = valid;
    if (i % 5 == 0) {
      bytes.resize(random.below(300));
      for (std::byte& b : bytes) b = static_cast<std::byte>(random.u32());
      if (i % 10 == 0 && bytes.size() > 4)
        bytes[0] = std::byte{0}, bytes[1] = static_cast<std::byte>(i / 10 % 2);
    } else if (i % 5 == 1) {
      bytes.resize(random.below(bytes.size() + 1));
    } else if (i % 5 == 2) {
      const std::uint32_t word = random.coin() ? 0xffffffffU : random.u32();
      const std::size_t at = random.below(bytes.size() / 4) * 4;
      std::memcpy(bytes.data() + at, &word, 4);
    } else {
      for (std::size_t flips = 1 + random.below(4); flips > 0; --flips)
        bytes[random.below(bytes.size())] ^= static_cast<std::byte>(1U << random.below(8));
    }
    if (!wire::decode<TypeParam>(bytes, back)) continue;
    ++accepted;
    ASSERT_TRUE(wire::encode(back, again));
  }
  testing::Test::RecordProperty("accepted", accepted);
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(60));
}

template <class T, class Change>
void expect_refused(const char* field, Change change) {
  T m;
  Payload payload;
  change(m);
  EXPECT_FALSE(wire::encode(m, payload)) << field;
  EXPECT_TRUE(payload.empty());
}

TEST(Codec, RefusesToSendWhatItWouldNotAccept) {
  expect_refused<wire::ArmState>("t_s", [](auto& m) { m.t_s = kNaN; });
  expect_refused<wire::ArmState>("dt_s", [](auto& m) { m.dt_s = wire::kInf; });
  expect_refused<wire::ArmState>("velocity", [](auto& m) { m.velocity.setZero(3); });
  expect_refused<wire::ArmState>("validity", [](auto& m) { m.validity = static_cast<wire::Validity>(5); });
  expect_refused<wire::Goal>("orientation", [](auto& m) {
    m.kind = wire::GoalKind::pose;
    m.orientation_xyzw = {0, 0, 0, 1.00001};
  });
  expect_refused<wire::ObstacleSet>("next_t_s", [](auto& m) { m.next_t_s = kNaN; });
  expect_refused<wire::ObstacleSet>("next_t_s", [](auto& m) { m.next_t_s = -wire::kInf; });
  expect_refused<wire::ObstacleSet>("obstacles", [](auto& m) { m.obstacles.resize(4097); });
  expect_refused<wire::ObstacleSet>("R", [](auto& m) {
    m.obstacles.resize(1);
    m.obstacles[0].X_WO.R(2, 2) = -1;  // a reflection
  });
  expect_refused<wire::ObstacleSet>("dims", [](auto& m) {
    m.obstacles.resize(1);
    m.obstacles[0].shape.dims_m[1] = -1;
  });
  expect_refused<wire::PlannerReport>("detail", [](auto& m) { m.detail.assign(257, 'x'); });
  expect_refused<wire::PlannerReport>("links", [](auto& m) { m.links.resize(65); });
  expect_refused<wire::ServiceStatus>("arm", [](auto& m) { m.arm = 1U << 28; });
  expect_refused<wire::ServiceStatus>("bus", [](auto& m) { m.bus = std::string("a\0b", 3); });
  expect_refused<wire::RobotDescription>("urdf", [](auto& m) { m.urdf.assign(262145, 'x'); });
}

TEST(Codec, SaysWhichFieldBrokeWhichRule) {
  wire::ModeCommand m, back;
  m.arm = 3, m.id = 7, m.mode = wire::Mode::resume;
  Payload payload = encoded(m);
  ASSERT_EQ(payload.size(), 24U);  // header 4, arm 4, padding 4, id 8, mode 4
  payload[20] = std::byte{4};
  auto result = wire::decode<wire::ModeCommand>(payload, back);
  ASSERT_FALSE(result);
  EXPECT_STREQ(result.error().field, "mode");
  EXPECT_STREQ(result.error().rule, "must be a known enum value");

  wire::ServiceStatus status, status_back;
  status.kind = wire::ServiceKind::planner, status.arm = 2;
  payload = encoded(status);
  EXPECT_EQ(payload[4], std::byte{2 * 16 + 2});
  payload[4] = std::byte{7};
  auto status_result = wire::decode<wire::ServiceStatus>(payload, status_back);
  ASSERT_FALSE(status_result);
  EXPECT_STREQ(status_result.error().field, "instance");
}

TEST(Codec, ReadsABigEndianPeer) {
  constexpr unsigned char kBytes[] = {0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 4, 0, 0, 0, 2};
  wire::ModeCommand back;
  ASSERT_TRUE(wire::decode<wire::ModeCommand>(std::as_bytes(std::span(kBytes)), back));
  EXPECT_EQ(back.arm, 0x102U);
  EXPECT_EQ(back.id, 0x304U);
  EXPECT_EQ(back.mode, wire::Mode::resume);
}

TEST(Codec, HugeLengthIsRefusedBeforeItAllocates) {
  wire::ObstacleSet m, back;
  Payload payload = encoded(m);
  for (std::size_t at = payload.size() - 4; at < payload.size(); ++at) payload[at] = std::byte{0x0f};
  EXPECT_FALSE(wire::decode<wire::ObstacleSet>(payload, back));
  EXPECT_EQ(back.obstacles.capacity(), 0U);
}

TEST(Codec, QuaternionsAreMadeExactlyUnit) {
  wire::Goal m, back;
  m.kind = wire::GoalKind::pose;
  m.orientation_xyzw = {0, 0, 0, 1 + 4e-7};
  ASSERT_TRUE(wire::decode<wire::Goal>(encoded(m), back));
  EXPECT_EQ(back.orientation_xyzw, Eigen::Vector4d(0, 0, 0, 1));
}

TEST(Codec, NamesItsIdl) { EXPECT_EQ(std::string(wire::idl_hash()).size(), 16U); }

}  // namespace
}  // namespace hamel
