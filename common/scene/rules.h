#pragma once
/// Collects violated rules under one prefix; for the validations of this folder only.

#include <charconv>
#include <cmath>
#include <string>
#include <utility>

#include "common/base/result.h"

namespace hamel::scene {

/// Shortest text that reads back as the same number.
inline std::string number(double v) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, v).ptr;
  return {text, end};
}

/// A list of problems whose names share a prefix, e.g. "dynamics.".
class Rules {
 public:
  explicit Rules(std::string prefix) : prefix_(std::move(prefix)) {}

  /// Notes "prefix + name" / "= value, must be `rule`" unless `ok`.
  void must(bool ok, const std::string& name, double value, const std::string& rule) {
    if (!ok) fail(name, "= " + number(value) + ", must be " + rule);
  }
  void positive(const std::string& name, double value) {
    must(finite(value) && value > 0, name, value, "> 0");
  }
  void positive_or_inf(const std::string& name, double value) { must(value > 0, name, value, "> 0"); }
  void not_negative(const std::string& name, double value) {
    must(finite(value) && value >= 0, name, value, ">= 0 and finite");
  }
  void within(const std::string& name, double value, double low, double high) {
    must(value >= low && value <= high, name, value, "in [" + number(low) + ", " + number(high) + "]");
  }
  void fail(const std::string& name, std::string what) {
    found_.push_back({prefix_ + name, std::move(what)});
  }
  Problems take() { return std::move(found_); }

 private:
  static bool finite(double v) { return std::isfinite(v); }
  std::string prefix_;
  Problems found_;
};

inline void append(Problems& to, Problems more) {
  for (Problem& p : more) to.push_back(std::move(p));
}

}  // namespace hamel::scene
