#include "common/files/stream.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "common/files/scene_text.h"
#include "common/record/reader.h"
#include "common/wire/codec.h"

namespace hamel::files {
namespace {

constexpr double kHold_s = 0.5;  // a set that holds is repeated so often

bool stands(const wire::ObstacleSet& set) {
  return std::all_of(set.obstacles.begin(), set.obstacles.end(),
                     [](const geometry::Obstacle& o) { return o.velocity_known && o.V_WO.isZero(0); });
}

/// Takes the obstacle sets of a recording in the order they were published.
class Sets {
 public:
  explicit Sets(const std::string& path) : path_(path) {}

  std::optional<Problem> add(record::View payload) {
    wire::ObstacleSet set;
    if (const auto ok = wire::decode<wire::ObstacleSet>(payload, set); !ok)
      return Problem{path_,
                     std::string("holds a set that is none: ") + ok.error().field + " " + ok.error().rule};
    if (last_ && set.source != last_->source)
      return Problem{path_, "holds sets of source " + std::to_string(last_->source) + " and of " +
                                std::to_string(set.source) + ", must be one"};
    if (last_ && set.t_s <= last_->t_s) return {};
    hold(set.t_s);
    put(set, set.t_s);
    last_ = std::move(set);
    return {};
  }

  /// `end_s`: the latest time of the recording.
  Result<StreamFile, Problem> finish(double end_s, const std::string& topic) {
    if (!last_) return Problem{path_, "holds no obstacle set of topic " + topic};
    hold(end_s);
    file_.first_s = *first_s_;
    return std::move(file_);
  }

 private:
  void hold(double until_s) {
    if (!last_ || !stands(*last_)) return;
    const double end_s = std::min(until_s, last_->next_t_s);
    for (int k = 1; last_->t_s + k * kHold_s < end_s; ++k) put(*last_, last_->t_s + k * kHold_s);
  }

  void put(const wire::ObstacleSet& set, double t_s) {
    if (!first_s_) first_s_ = t_s;
    if (set.obstacles.empty()) file_.empty_s.push_back(t_s);
    for (const geometry::Obstacle& o : set.obstacles)
      file_.samples.push_back({t_s, o.id, o.X_WO.p, o.shape, o.X_WO.R, o.sigma_m});
  }

  const std::string& path_;
  StreamFile file_;
  std::optional<wire::ObstacleSet> last_;
  std::optional<double> first_s_;
};

Result<StreamFile, Problem> load_recording(const std::string& path, const std::string& topic) {
  auto reader = record::StreamReader::open(path);
  if (!reader) return reader.error();
  const Topic& obstacles = wire::topic_of<wire::ObstacleSet>();
  std::map<std::uint16_t, record::Schema> schemas;
  std::optional<std::uint16_t> wanted;
  std::uint64_t end_ns = 0;
  Sets sets(path);
  while (const auto item = reader.value().next()) {
    if (const auto* d = std::get_if<record::Damage>(&*item))
      return Problem{path, "at byte " + std::to_string(d->offset) + ": " + d->what +
                               "; hamel log recover makes it whole"};
    if (const auto* s = std::get_if<record::Schema>(&*item)) schemas[s->id] = *s;
    if (const auto* c = std::get_if<record::Channel>(&*item);
        c && (c->topic == topic || c->topic == "hamel/v1/" + topic)) {
      if (schemas[c->schema].name != obstacles.type)
        return Problem{path, "topic " + topic + " holds " + schemas[c->schema].name + ", must be " +
                                 std::string(obstacles.type)};
      wanted = c->id;
    }
    const auto* m = std::get_if<record::Message>(&*item);
    if (m == nullptr) continue;
    end_ns = std::max(end_ns, m->log_time);
    if (m->channel != wanted) continue;
    if (const auto problem = sets.add(m->data)) return *problem;
  }
  return sets.finish(static_cast<double>(end_ns) * 1e-9, topic);
}

}  // namespace

Checked<StreamFile> load_stream(const std::string& path, const std::string& topic) {
  if (path.ends_with(".mcap")) {
    auto file = load_recording(path, topic);
    if (!file) return Problems{file.error()};
    return std::move(file).value();
  }
  const auto text = read_file(path);
  if (!text) return text.error();
  auto samples = scene::parse_stream(text.value(), path);
  if (!samples) return samples.error();
  const double first_s = samples.value().front().t_s;
  return StreamFile{std::move(samples).value(), {}, first_s};
}

}  // namespace hamel::files
