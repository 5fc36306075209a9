#pragma once
/// A payload of any topic as a list of named values, in the order of the IDL: for tools that show or compare
/// messages.

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/wire/codec.h"

namespace hamel::wire {

/// A sequence that holds nothing.
struct EmptyList {
  bool operator==(const EmptyList&) const = default;
};

struct Field {
  std::string path;  ///< "solver.stop", "position[0]", "links[2].point_on_link_m[1]"
  std::variant<std::uint64_t, double, bool, std::string, EmptyList> value;
};

/// Bit for bit: -0 is not 0.
bool same(const Field& a, const Field& b);

/// Every field of a payload of `topic`, exactly as it stands on the wire (enums as numbers), or what decode()
/// says.
Result<std::vector<Field>, DecodeError> fields(const Topic& topic, std::span<const std::byte> payload);

/// The sample time of a payload on the run's clock, for the topics that have one (state, command, obstacles,
/// report, clock).  Reads no further than that field; allocates nothing.
std::optional<double> sample_time_s(const Topic& topic, std::span<const std::byte> payload);

}  // namespace hamel::wire
