/// stranger VENDOR DOMAIN KIND: a peer that services cannot work with, until its standard input ends. `type`:
/// it writes goals of a type of its own; `qos`: statuses that late readers do not get; `idl`: the status of a
/// planner of another version and IDL.

#include <cstdlib>
#include <iostream>
#include <string>

#include "common/wire/endpoint.h"

using namespace hamel;

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  bus::NodeOptions o;
  o.vendor = bus::vendor_from(argv[1]).value();
  o.domain = static_cast<std::uint32_t>(std::atoi(argv[2]));
  o.name = "stranger";
  const std::string kind = argv[3];
  const auto node = std::move(bus::open(o)).value();
  Topic goal = topics::kGoal, status = topics::kStatus;
  if (kind == "type") goal.type = "elsewhere::Goal";
  if (kind == "qos") status.delivery = Delivery::stream;
  const auto goals = node->writer(goal);
  const auto statuses = node->writer(status);
  if (kind == "idl") {
    wire::ServiceStatus s;
    s.kind = wire::ServiceKind::planner, s.arm = 9, s.version = "9.9", s.idl_hash = "of-elsewhere",
    s.bus = argv[1];
    bus::Payload p;
    if (!wire::encode(s, p) || !statuses->write(p)) return 1;
  }
  std::string word;
  std::getline(std::cin, word);
}
