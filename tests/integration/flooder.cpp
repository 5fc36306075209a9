/// flooder VENDOR DOMAIN KIND SECONDS: a stranger that writes states, commands and obstacles of arm 1 as fast
/// as it can: `valid` ones (old, and of another planner and arm), `broken` ones, or `keys`: of 200 arms in
/// turn. Prints how many.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "common/wire/endpoint.h"

using namespace hamel;
using Clock = std::chrono::steady_clock;

namespace {

template <class T>
bus::Payload encoded(const T& m) {
  bus::Payload p;
  if (!wire::encode(m, p)) throw std::logic_error("not a message of ours");
  return p;
}

void spoil(bus::Payload& p, std::string_view kind, std::uint32_t i) {
  if (kind == "broken") {
    if (i % 2 == 0)
      p.resize(p.size() / 8 * 4);  // cut short
    else
      std::memset(p.data() + 8, 0xff, p.size() - 8);
  }
  const std::uint32_t key = 1000 + i % 200;
  if (kind == "keys") std::memcpy(p.data() + 4, &key, 4);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  bus::NodeOptions o;
  o.vendor = bus::vendor_from(argv[1]).value();
  o.domain = static_cast<std::uint32_t>(std::atoi(argv[2]));
  const std::string_view kind = argv[3];
  const auto node = std::move(bus::open(o)).value();
  wire::ArmState state;
  wire::TorqueCommand command;
  wire::ObstacleSet set;
  state.arm = command.arm = 1;
  set.source = 2;  // of another arm: one of arm 1 would be believed
  state.position = state.velocity = state.momentum = state.torque_applied = wire::JointVector::Zero(4);
  command.torque = wire::JointVector::Zero(4);
  Topic states = topics::kState, commands = topics::kCommand;
  states.delivery = commands.delivery = Delivery::latched;  // it keeps one of each key, and is fast
  const struct {
    std::unique_ptr<bus::Writer> writer;
    bus::Payload payload;
  } streams[] = {{node->writer(states), encoded(state)},
                 {node->writer(commands), encoded(command)},
                 {node->writer(topics::kObstacles), encoded(set)}};
  std::uint64_t sent = 0;
  const auto end = Clock::now() + std::chrono::milliseconds(static_cast<int>(1000 * std::atof(argv[4])));
  for (std::uint32_t i = 0; Clock::now() < end; ++i)
    for (const auto& s : streams) {
      bus::Payload p = s.payload;
      spoil(p, kind, i);
      sent += s.writer->write(p);
    }
  std::printf("%llu\n", static_cast<unsigned long long>(sent));
}
