#pragma once
/// A value or the reason there is none; and the list of problems a validation found.

#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace hamel {

/// A value or the reason there is none.  For edges only (files, wire, options): the hot path returns a
/// report by value instead.  Reading the side that is absent is our mistake and throws
/// std::bad_variant_access.
template <class T, class E>
class [[nodiscard]] Result {
 public:
  Result(T value) : v_(std::in_place_index<0>, std::move(value)) {}
  Result(E error) : v_(std::in_place_index<1>, std::move(error)) {}
  explicit operator bool() const noexcept { return v_.index() == 0; }
  const T& value() const& { return std::get<0>(v_); }
  T& value() & { return std::get<0>(v_); }
  T&& value() && { return std::get<0>(std::move(v_)); }
  const E& error() const { return std::get<1>(v_); }

 private:
  std::variant<T, E> v_;
};

/// One violated rule: where ("panda.urdf: link panda_link3", "scene.textproto:12:7: dynamics.dt_s") and what
/// ("= -1, must be > 0").
struct Problem {
  std::string where;
  std::string what;
};

/// Everything a validation found wrong, in the order of the input.  Empty means valid.
using Problems = std::vector<Problem>;

inline std::string to_string(const Problem& p) { return p.where + ": " + p.what; }

/// A value, or every problem that kept it from being made.
template <class T>
using Checked = Result<T, Problems>;

}  // namespace hamel
