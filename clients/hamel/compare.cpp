#include "clients/hamel/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace hamel::client {

namespace {

/// "links[2].point_on_link_m[1]" -> "links.point_on_link_m"
std::string without_indices(const std::string& path) {
  std::string out;
  bool inside = false;
  for (const char c : path) {
    if (c == '[') inside = true;
    if (!inside) out += c;
    if (c == ']') inside = false;
  }
  return out;
}

std::string show(const wire::Field& f) {
  if (const auto* u = std::get_if<std::uint64_t>(&f.value)) return std::to_string(*u);
  if (const auto* d = std::get_if<double>(&f.value)) return fmt::format("{:.17g}", *d);
  if (const auto* b = std::get_if<bool>(&f.value)) return *b ? "true" : "false";
  if (const auto* s = std::get_if<std::string>(&f.value)) return "\"" + *s + "\"";
  return "[]";
}

}  // namespace

std::optional<Problem> Comparison::tolerate(const std::string& text) {
  const auto equals = text.find('=');
  double value = -1;
  const char *number = text.data() + equals + 1, *end = text.data() + text.size();
  if (equals == std::string::npos || std::from_chars(number, end, value).ptr != end ||
      !std::isfinite(value) || !(value >= 0))
    return Problem{"--tolerance " + text, "must be FIELD=NUMBER, e.g. torque=1e-9 or *=1e-12"};
  tolerances_[text.substr(0, equals)] = value;
  return {};
}

const std::set<std::string>& Comparison::excluded() {
  static const std::set<std::string> names{"cycle_time_s"};
  return names;
}

bool Comparison::close_enough(const wire::Field& a, const wire::Field& b, const std::string& name) const {
  const auto of_all = tolerances_.find("*"), own = tolerances_.find(name);
  const auto t = own != tolerances_.end() ? own : of_all;
  if (t == tolerances_.end() || a.value.index() != b.value.index()) return false;
  if (const auto* x = std::get_if<double>(&a.value))
    return std::abs(*x - std::get<double>(b.value)) <= t->second;
  const auto* u = std::get_if<std::uint64_t>(&a.value);
  if (u == nullptr || t != own) return false;  // a whole number only where it is named
  return std::abs(static_cast<double>(*u) - static_cast<double>(std::get<std::uint64_t>(b.value))) <=
         t->second;
}

void Comparison::compare(const Topic& topic, std::uint64_t step, std::span<const std::byte> recorded,
                         std::span<const std::byte> replayed) {
  ++compared_;
  if (std::equal(recorded.begin(), recorded.end(), replayed.begin(), replayed.end())) return;
  const auto a = wire::fields(topic, recorded), b = wire::fields(topic, replayed);
  if (!a || !b) return missing(topic, step);
  const std::string t(topic.name);
  const auto differ = [&](Difference d) {
    ++different_;
    if (!first_) first_ = std::move(d);
  };
  for (std::size_t i = 0; i < std::max(a.value().size(), b.value().size()); ++i) {
    if (i >= a.value().size()) return differ({t, b.value()[i].path, "absent", show(b.value()[i]), step});
    if (i >= b.value().size()) return differ({t, a.value()[i].path, show(a.value()[i]), "absent", step});
    const wire::Field &x = a.value()[i], &y = b.value()[i];
    const std::string name = without_indices(x.path);
    if (wire::same(x, y) || (x.path == y.path && (excluded().contains(name) || close_enough(x, y, name))))
      continue;
    return differ({t, x.path, show(x), x.path == y.path ? show(y) : y.path + " = " + show(y), step});
  }
}

void Comparison::missing(const Topic& topic, std::uint64_t step) {
  ++different_;
  if (!first_) first_ = Difference{std::string(topic.name), "the message", "there", "absent", step};
}

}  // namespace hamel::client
