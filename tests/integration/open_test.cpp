/// What is wrong with a network is said in one sentence, before anything is sent.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

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

/// What a process holds that outlives nothing: open files, threads, shared memory; and its memory [kB].
struct Holdings {
  std::size_t files = 0, threads = 0, segments = 0;
  long resident_kB = 0;

  static std::size_t entries(const char* folder, const char* with = "") {
    std::size_t n = 0;
    for (const auto& e : std::filesystem::directory_iterator(folder))
      n += e.path().filename().string().find(with) != std::string::npos;
    return n;
  }
  static Holdings now() {
    Holdings h{entries("/proc/self/fd"), entries("/proc/self/task"), entries("/dev/shm", "fast"), 0};
    std::ifstream statm("/proc/self/statm");
    long pages = 0;
    statm >> pages >> pages;
    h.resident_kB = pages * (sysconf(_SC_PAGESIZE) / 1024);
    return h;
  }
};

// 1000 times with HAMEL_SOAK=1.  Two nodes that meet: each also sees the other come and go.
TEST_P(Open, AgainAndAgainLeavesNoFileThreadOrSegment) {
  const char* soak = std::getenv("HAMEL_SOAK");
  const int cycles = soak != nullptr && *soak == '1' ? 1000 : 20, warm_up = 10;
  const auto cycle = [&] {
    auto here = bus::open(options(232)), there = bus::open(options(232));  // few ports to spare
    ASSERT_TRUE(here && there);
    const auto reader = here.value()->reader(topics::kState);
    const auto writer = there.value()->writer(topics::kState);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    bus::Payload p(400);
    p[1] = std::byte{1};
    while (!reader->take(p) && std::chrono::steady_clock::now() < deadline) {
      writer->write(p);
      here.value()->wait(std::chrono::steady_clock::now() + std::chrono::milliseconds(1));
    }
    EXPECT_EQ(reader->counters().samples, 1u);
  };
  for (int i = 0; i < warm_up; ++i) cycle();
  const Holdings before = Holdings::now();
  for (int i = 0; i < cycles && !HasFailure(); ++i) cycle();
  const Holdings after = Holdings::now();
  EXPECT_EQ(after.files, before.files);
  EXPECT_EQ(after.threads, before.threads);
  EXPECT_EQ(after.segments, before.segments);
  const long grown_kB = after.resident_kB - before.resident_kB;
  std::printf("%s: %d cycles; %zu files, %zu threads, %zu segments as before; %ld kB more\n",
              to_string(GetParam()), cycles, after.files, after.threads, after.segments, grown_kB);
  EXPECT_LT(grown_kB, 4096 + 4 * cycles);
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
