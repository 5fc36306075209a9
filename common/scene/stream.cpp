#include "common/scene/stream.h"

#include <charconv>
#include <cmath>
#include <set>
#include <system_error>

namespace hamel::scene {
namespace {

constexpr std::size_t kMostProblems = 20;

/// Reads one row after the other and remembers what the next one is compared with.
class Reader {
 public:
  explicit Reader(const std::string& name) : name_(name) {}

  void line(std::string_view text) {
    ++line_;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    if (text.empty() || text.front() == '#') return;
    if (!header_seen_) {
      header_seen_ = true;
      if (text != kStreamHeader)
        fail("header is \"" + std::string(text) + "\", must be \"" + std::string(kStreamHeader) + "\"");
      return;
    }
    if (row(text)) samples_.push_back(sample_);
  }

  bool full() const { return problems_.size() >= kMostProblems; }

  Checked<std::vector<StreamSample>> finish() {
    if (!header_seen_) fail("is empty, must begin with \"" + std::string(kStreamHeader) + "\"");
    if (problems_.empty() && samples_.empty()) fail("has no rows");
    if (!problems_.empty()) return std::move(problems_);
    return std::move(samples_);
  }

 private:
  bool row(std::string_view text) {
    std::string_view cells[6];
    std::size_t count = 0;
    for (std::string_view rest = text;; ++count) {
      const std::size_t comma = rest.find(',');
      if (count < 6) cells[count] = rest.substr(0, comma);
      if (comma == std::string_view::npos) break;
      rest.remove_prefix(comma + 1);
    }
    if (++count != 6) return fail("has " + std::to_string(count) + " columns, must have 6");
    bool ok = read(cells[0], "t_s", sample_.t_s);
    ok &= read_id(cells[1]);
    ok &= read(cells[2], "x_m", sample_.p_m.x());
    ok &= read(cells[3], "y_m", sample_.p_m.y());
    ok &= read(cells[4], "z_m", sample_.p_m.z());
    ok &= read(cells[5], "radius_m", sample_.shape.dims_m[0]);
    return ok && follows_rules(cells[0], cells[5]);
  }

  bool follows_rules(std::string_view t, std::string_view radius) {
    if (!samples_.empty() && sample_.t_s < samples_.back().t_s)
      return fail("t_s = " + std::string(t) + ", time goes backwards");
    if (sample_.shape.dims_m[0] < 0) return fail("radius_m = " + std::string(radius) + ", must be >= 0");
    if (samples_.empty() || sample_.t_s > samples_.back().t_s) ids_now_.clear();
    if (!ids_now_.insert(sample_.id).second)
      return fail("id " + std::to_string(sample_.id) + " occurs twice at t_s = " + std::string(t));
    return true;
  }

  bool read(std::string_view cell, const char* column, double& out) {
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), out);
    if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(out))
      return fail(std::string(column) + " = \"" + std::string(cell) + "\", not a finite number");
    return true;
  }

  bool read_id(std::string_view cell) {
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), sample_.id);
    if (error != std::errc() || end != cell.data() + cell.size())
      return fail("id = \"" + std::string(cell) + "\", must be a whole number from 0 to 4294967295");
    return true;
  }

  bool fail(const std::string& what) {
    problems_.push_back({name_ + ":" + std::to_string(line_), what});
    return false;
  }

  const std::string& name_;
  int line_ = 0;
  bool header_seen_ = false;
  StreamSample sample_;
  std::set<std::uint32_t> ids_now_;
  std::vector<StreamSample> samples_;
  Problems problems_;
};

}  // namespace

Checked<std::vector<StreamSample>> parse_stream(std::string_view text, const std::string& name) {
  Reader reader(name);
  while (!text.empty() && !reader.full()) {
    const std::size_t end = text.find('\n');
    reader.line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return reader.finish();
}

}  // namespace hamel::scene
