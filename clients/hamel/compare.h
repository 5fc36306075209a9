#pragma once
/// Messages of a replay against those of its recording: bit for bit, or within a stated tolerance of a field.

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/fields.h"

namespace hamel::client {

struct Difference {
  std::string topic, field, recorded, replayed;
  std::uint64_t step = 0;
};

class Comparison {
 public:
  /// "torque=1e-9" (path without indices; whole numbers too) or "*=1e-12" (every real number); absolute.
  std::optional<Problem> tolerate(const std::string& field_and_value);
  /// Left out by name: what is wall time by its nature.
  static const std::set<std::string>& excluded();

  void compare(const Topic& topic, std::uint64_t step, std::span<const std::byte> recorded,
               std::span<const std::byte> replayed);
  /// A message that the replay did not give.
  void missing(const Topic& topic, std::uint64_t step);

  std::uint64_t compared() const { return compared_; }
  std::uint64_t different() const { return different_; }
  const std::optional<Difference>& first() const { return first_; }

 private:
  bool close_enough(const wire::Field& a, const wire::Field& b, const std::string& name) const;
  std::map<std::string, double> tolerances_;
  std::uint64_t compared_ = 0, different_ = 0;
  std::optional<Difference> first_;
};

}  // namespace hamel::client
