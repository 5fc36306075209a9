#include "common/files/batch_text.h"

#include <scene.pb.h>

#include <cmath>
#include <filesystem>

#include "common/files/scene_text.h"
#include "common/files/text_fields.h"

namespace hamel::files {
namespace {

constexpr double kMost = 1e7;

Vary read_vary(const text::Vary& m) {
  Vary out;
  out.field = m.field();
  out.values.assign(m.values().begin(), m.values().end());
  if (m.has_from()) out.from = m.from();
  if (m.has_to()) out.to = m.to();
  out.count = m.count();
  return out;
}

/// What is wrong with one `vary`, or nothing.
std::string fault(const Vary& v, bool random) {
  if (v.field.empty()) return "field is missing";
  const bool range = v.from && v.to;
  if (range == !v.values.empty() || bool(v.from) != bool(v.to)) return "must have values, or from and to";
  if (range && (!std::isfinite(*v.from) || !std::isfinite(*v.to))) return "from and to must be finite";
  if (range && !random && v.count < 2) return "count must be >= 2";
  return "";
}

}  // namespace

Checked<BatchText> load_batch(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return text.error();
  text::Batch message;
  ParsedText parsed;
  parse_text(text.value(), path, message, parsed);
  Problems found = parsed.problems;
  BatchText out;
  if (message.has_scene())
    out.scene_path =
        (std::filesystem::path(path).parent_path() / message.scene()).lexically_normal().string();
  out.random = message.random();
  if (message.has_seed()) out.seed = message.seed();
  out.set.assign(message.set().begin(), message.set().end());
  double product = 1;
  for (int i = 0; i < message.vary_size(); ++i) {
    out.vary.push_back(read_vary(message.vary(i)));
    const Vary& v = out.vary.back();
    const TextPosition at = find_position(message, parsed.positions, "vary[" + std::to_string(i) + "]");
    const std::string where = path + ":" + std::to_string(at.line) + ":" + std::to_string(at.column);
    if (const std::string why = fault(v, out.random > 0); !why.empty())
      found.push_back({where, "vary: " + why});
    for (int k = 0; k < i; ++k)
      if (out.vary[static_cast<std::size_t>(k)].field == v.field)
        found.push_back({where, "vary: " + v.field + " varies already"});
    product *= v.values.empty() ? v.count : static_cast<double>(v.values.size());
  }
  if (out.vary.empty()) found.push_back({path, "varies nothing"});
  if (out.random > kMost)
    found.push_back({path, "random = " + std::to_string(out.random) + " is more than 1e7 variations"});
  if (out.random == 0 && product > kMost) found.push_back({path, "is a grid of more than 1e7 variations"});
  if (!found.empty()) return found;
  return out;
}

}  // namespace hamel::files
