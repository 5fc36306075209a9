#include "clients/hamel/play_source.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "clients/hamel/record.h"
#include "common/files/stream.h"
#include "common/record/reader.h"
#include "common/runtime/log.h"
#include "common/wire/codec.h"
#include "services/perception/core/source.h"

namespace hamel::client {

namespace {

class RecordedSource final : public PlaySource {
 public:
  RecordedSource(record::IndexedReader in, const PlayArgs& args) : path_(args.path), in_(std::move(in)) {
    query_.begin = ns(args.begin_s);
    if (args.end_s >= 0) query_.end = ns(args.end_s);
    for (const std::string& name : args.topics) query_.topics.emplace(find_topic(name)->name);
    for (const auto& [id, channel] : in_.summary().channels)
      if (query_.topics.contains(channel.topic)) topics_[id] = find_topic(channel.topic);
  }
  std::vector<const Topic*> topics() const override {
    std::vector<const Topic*> out;
    for (const auto& [id, topic] : topics_) out.push_back(topic);
    return out;
  }
  void rewind() override { in_.seek(query_); }
  std::optional<Played> next() override {
    while (const auto item = in_.next()) {
      if (const auto* m = std::get_if<record::Message>(&*item))
        return Played{topics_.at(m->channel), m->log_time, m->data};
      const auto& d = std::get<record::Damage>(*item);
      spdlog::warn("{}: at byte {}: {}", path_, d.offset, d.what);
    }
    return {};
  }

 private:
  const std::string path_;
  record::IndexedReader in_;
  record::Query query_;
  std::map<std::uint16_t, const Topic*> topics_;
};

class CsvSource final : public PlaySource {
 public:
  CsvSource(perception::Source source, std::vector<double> times_s, const PlayArgs& args)
      : source_(std::move(source)), times_s_(std::move(times_s)) {
    set_.source = args.arm;
    set_.incarnation = 1;
  }
  std::vector<const Topic*> topics() const override { return {&topics::kObstacles}; }
  void rewind() override { at_ = 0; }
  std::optional<Played> next() override {
    if (at_ == times_s_.size()) return {};
    set_.t_s = times_s_[at_];
    set_.sequence_number = at_++;
    const double again_s = set_.t_s + source_.period_s();
    set_.next_t_s = at_ < times_s_.size() ? times_s_[at_] : again_s;
    source_.at(set_.t_s, set_.obstacles);
    wire::encode(set_, payload_);
    return Played{&topics::kObstacles, ns(set_.t_s), payload_};
  }

 private:
  const perception::Source source_;
  const std::vector<double> times_s_;
  wire::ObstacleSet set_;
  bus::Payload payload_;
  std::size_t at_ = 0;
};

Checked<std::unique_ptr<PlaySource>> open_csv(const PlayArgs& args) {
  auto file = files::load_stream(args.path, "");
  if (!file) return file.error();
  scene::PerceptionOptions options;
  scene::Stream& s = options.stream.emplace();
  s.samples = std::move(file.value().samples);
  std::vector<double> times_s;
  for (const auto& sample : s.samples) {
    const bool wanted = sample.t_s >= args.begin_s && (args.end_s < 0 || sample.t_s <= args.end_s);
    if (wanted && (times_s.empty() || sample.t_s > times_s.back())) times_s.push_back(sample.t_s);
  }
  if (file.value().first_s < 0) return Problems{{args.path, "begins before 0 s, which a set's time cannot"}};
  auto source = perception::Source::make(options);
  if (!source) return source.error();
  return std::unique_ptr<PlaySource>(new CsvSource(std::move(source).value(), std::move(times_s), args));
}

}  // namespace

Checked<std::unique_ptr<PlaySource>> open_play_source(const PlayArgs& args) {
  for (const std::string& name : args.topics)
    if (find_topic(name) == nullptr) return Problems{{"--topic " + name, "is no topic of hamel"}};
  if (args.path.ends_with(".csv")) return open_csv(args);
  auto file = record::IndexedReader::open(args.path);
  if (!file) return Problems{file.error()};
  return std::unique_ptr<PlaySource>(new RecordedSource(std::move(file).value(), args));
}

}  // namespace hamel::client
