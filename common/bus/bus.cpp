#include "common/bus/bus.h"

#include "common/bus/backends.h"

namespace hamel::bus {
namespace {

constexpr std::array kVendors{Vendor::inproc, Vendor::fastdds, Vendor::cyclonedds};

}  // namespace

const char* to_string(Vendor v) {
  switch (v) {
    case Vendor::inproc:
      return "inproc";
    case Vendor::fastdds:
      return "fastdds";
    case Vendor::cyclonedds:
      return "cyclonedds";
  }
  return "?";
}

std::string library_version(Vendor vendor) {
  if (vendor == Vendor::fastdds) return fastdds_version();
  return vendor == Vendor::cyclonedds ? cyclonedds_version() : "";
}

Result<Vendor, Problem> vendor_from(std::string_view name) {
  for (const Vendor v : kVendors)
    if (name == to_string(v)) return v;
  return Problem{"bus", "= " + std::string(name) + ", must be inproc, fastdds or cyclonedds"};
}

Result<std::unique_ptr<Node>, Problem> open(const NodeOptions& options) {
  if (options.domain > kMaxDomain)
    return Problem{"domain", "= " + std::to_string(options.domain) + ", must be 0.." +
                                 std::to_string(kMaxDomain) + " (a larger one has no UDP ports)"};
  switch (options.vendor) {
    case Vendor::inproc:
      return open_inproc(options);
    case Vendor::fastdds:
      return open_fastdds(options);
    case Vendor::cyclonedds:
      return open_cyclonedds(options);
  }
  return Problem{"bus", "is no known vendor"};
}

}  // namespace hamel::bus
