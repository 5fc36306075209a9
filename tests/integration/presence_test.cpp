/// What a service says of peers that it cannot work with.

#include "common/runtime/presence.h"

#include <gtest/gtest.h>

namespace hamel {
namespace {

using namespace std::chrono_literals;
using runtime::Clock;
using wire::ServiceStatus;

std::unique_ptr<bus::Node> open(bus::Vendor vendor, std::uint32_t domain, const char* name) {
  bus::NodeOptions o;
  o.vendor = vendor;
  o.domain = domain;
  o.name = name;
  return std::move(bus::open(o)).value();
}

/// Says `word` in its status before the deadline.
testing::AssertionResult comes_to_say(runtime::Presence& presence, bus::Node& node, bus::Node& listener,
                                      const std::vector<std::string>& words) {
  wire::Subscription<ServiceStatus> statuses(listener);
  ServiceStatus s;
  std::string last;
  for (const auto deadline = Clock::now() + 20s; Clock::now() < deadline;) {
    node.wait(Clock::now() + 5ms);
    presence.say(Clock::now(), {.detail = "as ever", .counters = {}});
    while (statuses.take(s))
      if (s.kind == wire::ServiceKind::dynamics) last = s.detail;
    if (std::all_of(words.begin(), words.end(),
                    [&](const std::string& w) { return last.find(w) != std::string::npos; }))
      return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << last;
}

TEST(Presence, NamesAPeerOfAnotherVersionAndIdl) {
  const auto here = open(bus::Vendor::inproc, 41, "here"), there = open(bus::Vendor::inproc, 41, "there");
  runtime::Presence presence(*here, wire::ServiceKind::dynamics, 1);
  wire::Publisher<ServiceStatus> other(*there);
  ServiceStatus s;
  s.kind = wire::ServiceKind::planner, s.arm = 1, s.version = "9.9", s.idl_hash = "other";
  ASSERT_TRUE(other.publish(s));
  EXPECT_TRUE(comes_to_say(presence, *here, *there, {"as ever", "planner of arm 1 is 9.9 with IDL other"}));
  EXPECT_EQ(presence.strangers(), 1U);
}

class PresenceOver : public testing::TestWithParam<bus::Vendor> {};

TEST_P(PresenceOver, NamesAPeerOfAnotherQos) {
  const std::uint32_t domain = GetParam() == bus::Vendor::fastdds ? 222 : 223;
  const auto here = open(GetParam(), domain, "here"), there = open(GetParam(), domain, "there");
  runtime::Presence presence(*here, wire::ServiceKind::dynamics, 1);
  Topic passing = topics::kStatus;
  passing.delivery = Delivery::stream;
  const auto writer = there->writer(passing);
  EXPECT_TRUE(comes_to_say(presence, *here, *there,
                           {"as ever", "hamel/v1/status", "durability", "our reader asks for transient-local",
                            "of there offers volatile"}));
}

INSTANTIATE_TEST_SUITE_P(Vendors, PresenceOver,
                         testing::Values(bus::Vendor::fastdds, bus::Vendor::cyclonedds),
                         [](const auto& v) { return std::string(to_string(v.param)); });

}  // namespace
}  // namespace hamel
