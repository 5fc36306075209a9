#include "common/runtime/loop.h"

#include <algorithm>

namespace hamel::runtime {

bool run(bus::Node& node, std::span<Service* const> services, const Service& lead, StopSignal& stop) {
  stop.on_stop([&node] { node.wake(); });
  while (!stop.requested() && !lead.finished()) {
    bool progressed = false;
    for (Service* s : services) progressed |= s->poll(Clock::now());
    if (progressed) continue;
    auto due = Clock::now() + std::chrono::milliseconds(200);
    for (const Service* s : services) due = std::min(due, s->due());
    node.wait(due);
  }
  stop.on_stop({});
  for (Service* s : services) s->close();
  return !stop.requested();
}

void await_readers(bus::Node& node, const Service& service, int readers, StopSignal& stop) {
  if (readers <= 0) return;
  const auto deadline = Clock::now() + std::chrono::seconds(5);
  while (service.readers() < readers && Clock::now() < deadline && !stop.requested())
    node.wait(Clock::now() + std::chrono::milliseconds(10));
  const auto settled = Clock::now() + std::chrono::milliseconds(200);
  while (Clock::now() < settled && !stop.requested()) node.wait(settled);
}

void linger(bus::Node& node) {
  if (node.options().vendor == bus::Vendor::inproc) return;
  const auto until = Clock::now() + std::chrono::milliseconds(300);
  while (Clock::now() < until) node.wait(until);
}

}  // namespace hamel::runtime
