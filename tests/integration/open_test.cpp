/// What is wrong with a network is said in one sentence, before anything is sent.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/bus/bus.h"

namespace hamel {
namespace {

using bus::NodeOptions;
using bus::Vendor;

class Open : public testing::TestWithParam<Vendor> {
 protected:
  NodeOptions options(std::uint32_t domain) {
    NodeOptions o;
    o.vendor = GetParam();
    o.domain = domain;
    return o;
  }
  std::string sentence(const NodeOptions& o) {
    const auto node = bus::open(o);
    return node ? "opened" : to_string(node.error());
  }
};

TEST_P(Open, NamesAnInterfaceThatDoesNotExist) {
  NodeOptions o = options(20);
  o.interface_name = "nosuch0";
  EXPECT_TRUE(sentence(o).starts_with("interface: = nosuch0, does not exist; there are: ")) << sentence(o);
  o.interface_name = "192.0.2.77";
  EXPECT_TRUE(sentence(o).starts_with("interface: = 192.0.2.77, does not exist")) << sentence(o);
}

TEST_P(Open, NamesAPeerThatIsNoAddress) {
  NodeOptions o = options(20);
  o.peers = {"127.0.0.1", "robot.local"};
  EXPECT_EQ(sentence(o), "peers: = robot.local, must be an IPv4 address");
}

TEST_P(Open, RefusesADomainWithoutPorts) {
  EXPECT_EQ(sentence(options(233)), "domain: = 233, must be 0..232 (a larger one has no UDP ports)");
  EXPECT_EQ(sentence(options(232)), "opened");
}

TEST_P(Open, SaysThatNoParticipantIndexIsFree) {
  const std::uint32_t domain = GetParam() == Vendor::fastdds ? 21 : 22;
  std::vector<int> sockets;  // one port of every pair
  for (int index = 0; index <= 49; ++index) {
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10 + 2 * index + index % 2));
    ASSERT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    sockets.push_back(fd);
  }
  EXPECT_TRUE(sentence(options(domain))
                  .starts_with("domain: = " + std::to_string(domain) + ", has no free participant index"))
      << sentence(options(domain));
  close(sockets.back());
  EXPECT_EQ(sentence(options(domain)), "opened");
  for (std::size_t i = 0; i + 1 < sockets.size(); ++i) close(sockets[i]);
}

TEST_P(Open, OpensAndClosesAgainAndAgain) {
  for (int i = 0; i < 100; ++i) {
    auto node = bus::open(options(232));  // the one with the fewest ports to spare
    ASSERT_TRUE(node) << to_string(node.error());
    const auto reader = node.value()->reader(topics::kState);
    const auto writer = node.value()->writer(topics::kState);
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, Open, testing::Values(Vendor::fastdds, Vendor::cyclonedds),
                         [](const auto& tested) { return std::string(to_string(tested.param)); });

TEST(Vendors, AreFoundByName) {
  EXPECT_EQ(bus::vendor_from("cyclonedds").value(), Vendor::cyclonedds);
  EXPECT_EQ(to_string(bus::vendor_from("opendds").error()),
            "bus: = opendds, must be inproc, fastdds or cyclonedds");
}

}  // namespace
}  // namespace hamel
