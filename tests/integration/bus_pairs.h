#pragma once
/// What the tests of the bus share: nodes of every pair of vendors, samples, waits that end with the event or
/// a deadline.  Each test has a domain of its own.

#include <gtest/gtest.h>

#include <cstring>
#include <stdexcept>
#include <string>

#include "common/bus/bus.h"

namespace hamel::test {

using bus::Payload;
using bus::Vendor;
using namespace std::chrono_literals;

inline constexpr auto kDeadline = 20s;  // generous: a test that waits this long has failed

/// A payload of `topic`: header, key, a number, then filling.
inline Payload sample(std::uint32_t key, std::uint32_t number, std::size_t size = 32) {
  Payload p(size);
  p[1] = std::byte{1};
  std::memcpy(p.data() + 4, &key, 4);
  std::memcpy(p.data() + 8, &number, 4);
  return p;
}
inline std::uint32_t key_in(const Payload& p) {
  std::uint32_t key;
  std::memcpy(&key, p.data() + 4, 4);
  return key;
}
inline std::uint32_t number_in(const Payload& p) {
  std::uint32_t number;
  std::memcpy(&number, p.data() + 8, 4);
  return number;
}

using Log = std::function<void(const std::string&)>;

inline std::unique_ptr<bus::Node> open(Vendor vendor, std::uint32_t domain, Log log = {},
                                       const std::string& name = "hamel") {
  bus::NodeOptions options;
  options.name = name;
  options.vendor = vendor;
  options.domain = domain;
  options.log = std::move(log);
  auto node = bus::open(options);
  if (!node) throw std::runtime_error(to_string(node.error()));
  return std::move(node).value();
}

/// Waits on `node` until `done`; false when the deadline passes first.
template <class Done>
bool wait_for(bus::Node& node, Done done, std::chrono::milliseconds patience = kDeadline) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!done()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    node.wait(std::min(deadline, std::chrono::steady_clock::now() + 5ms));  // matching does not wake
  }
  return true;
}

/// The two ends: who writes and who reads.
struct Pair {
  Vendor from, to;
  std::uint32_t domain;
};

class Bus : public testing::TestWithParam<Pair> {
 protected:
  std::unique_ptr<bus::Node> from(std::uint32_t n, Log log = {}) {
    return open(GetParam().from, GetParam().domain + n, std::move(log));
  }
  std::unique_ptr<bus::Node> to(std::uint32_t n, Log log = {}) {
    return open(GetParam().to, GetParam().domain + n, std::move(log));
  }
};

inline const auto kPairs = testing::Values(
    Pair{Vendor::inproc, Vendor::inproc, 100}, Pair{Vendor::fastdds, Vendor::fastdds, 120},
    Pair{Vendor::cyclonedds, Vendor::cyclonedds, 140}, Pair{Vendor::fastdds, Vendor::cyclonedds, 160},
    Pair{Vendor::cyclonedds, Vendor::fastdds, 180});
inline std::string name_of(const testing::TestParamInfo<Pair>& info) {
  return std::string(to_string(info.param.from)) + "_to_" + to_string(info.param.to);
}

}  // namespace hamel::test
