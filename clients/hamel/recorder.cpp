#include "clients/hamel/recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/wire/fields.h"

namespace hamel::client {

namespace {

constexpr std::size_t kBatch = 1024;  // samples of a topic taken at once
constexpr int kDepth = 4096;          // samples of a topic that may wait: four seconds at 1 kHz,
constexpr int kLatchedDepth = 64;     // two seconds of obstacles

/// Causes before effects; what has no sample time is taken up before (goals, modes) or after the rest.
constexpr std::array kOrder{&topics::kRobot,     &topics::kMode,  &topics::kGoal,    &topics::kClock,
                            &topics::kObstacles, &topics::kState, &topics::kCommand, &topics::kReport,
                            &topics::kSummary,   &topics::kStatus};
static_assert(kOrder.size() == kTopics.size());

std::uint64_t ns(double t_s) {
  constexpr double kMost = 9.2e18;
  return static_cast<std::uint64_t>(std::llround(std::clamp(t_s * 1e9, 0.0, kMost)));
}

record::Map qos(const Topic& t) {
  const bool latched = t.delivery == Delivery::latched;
  return {{"reliability", "reliable"},
          {"durability", latched ? "transient_local" : "volatile"},
          {"history", fmt::format("keep_last {}", latched ? 1 : kStreamDepth)},
          {"keyed", t.keyed ? "true" : "false"},
          {"rate_hz", fmt::format("{}", t.rate_hz)},
          {"stale_ms", std::to_string(t.stale.count())}};
}

}  // namespace

Result<std::unique_ptr<Recorder>, Problem> Recorder::open(bus::Node& node, const RecorderOptions& options) {
  auto file = record::Writer::create(options.path,
                                     {.compression = options.compression, .library = runtime::version()});
  if (!file) return file.error();
  std::unique_ptr<Recorder> r(new Recorder(node, options, std::move(file).value()));
  if (r->problem()) return *r->problem();
  return r;
}

Recorder::Recorder(bus::Node& node, const RecorderOptions& options, std::unique_ptr<record::Writer> file)
    : file_(std::move(file)) {
  begin(options);

  for (std::size_t i = 0; i < kOrder.size(); ++i) {
    const Topic& t = *kOrder[i];
    const auto schema =
        file_->add(record::Schema{0, std::string(t.type), "omgidl", std::string(wire::idl_text())});
    lines_[i].topic = &t;
    lines_[i].channel = file_->add(record::Channel{0, schema, std::string(t.name), "cdr", qos(t)});
    lines_[i].reader = node.reader(t, t.delivery == Delivery::latched ? kLatchedDepth : kDepth);
  }
}

void Recorder::begin(const RecorderOptions& o) {
  const auto attach = [this](const std::string& name, const std::string& type, std::string text) {
    file_->write(record::Attachment{0, 0, name, type, std::move(text)});
  };
  attach("hamel_v1.idl", "text/plain", std::string(wire::idl_text()));
  record::Metadata about{"hamel",
                         {{"version", runtime::version()}, {"idl_hash", wire::idl_hash()}, {"pace", o.pace}}};
  if (o.scene != nullptr) {
    const scene::Scene& s = *o.scene;
    about.entries.insert(about.entries.end(), {{"scene", s.name},
                                               {"robot", s.robot.name},
                                               {"arm", std::to_string(s.arm)},
                                               {"duration_s", fmt::format("{}", s.duration_s)}});
    attach("scene.textproto", "text/plain", s.text);
    attach("robot.urdf", "application/xml", s.robot.urdf);
    if (!s.robot.spheres.empty()) attach("robot.spheres.textproto", "text/plain", s.robot.spheres);
    if (s.perception.stream)
      if (auto stream = files::read_file(s.perception.stream->path)) {
        const bool recording = s.perception.stream->path.ends_with(".mcap");
        attach(recording ? "stream.mcap" : "stream.csv", recording ? "application/octet-stream" : "text/csv",
               stream.value());
      }
  }
  file_->write(about);
}

bool Recorder::poll(runtime::Clock::time_point now) {
  const bool heard = take();
  while (Line* line = earliest()) put(*line, now);
  for (Line& line : lines_) line.waiting.clear(), line.next = 0;
  file_->tick(now);
  if (problem() && !told_) {
    told_ = true;
    spdlog::error("{}; the run goes on without being recorded", to_string(*problem()));
  }
  return heard;
}

bool Recorder::take() {
  bool any = false;
  for (Line& line : lines_) {
    Sample s;
    while (line.waiting.size() < kBatch && line.reader->take(s.payload)) {
      const auto t_s = wire::sample_time_s(*line.topic, s.payload);
      s.timed = t_s.has_value();
      s.time = t_s ? ns(*t_s) : 0;
      line.waiting.push_back(std::move(s));
      any = true;
    }
  }
  return any;
}

/// The topic whose next message goes first; those without a time go where kOrder has them.
Recorder::Line* Recorder::earliest() {
  Line* best = nullptr;
  for (Line& line : lines_) {
    if (line.next >= line.waiting.size()) continue;
    const Sample& s = line.waiting[line.next];
    const bool first =
        line.topic == &topics::kRobot || line.topic == &topics::kMode || line.topic == &topics::kGoal;
    if (!s.timed && first) return &line;
    if (best == nullptr) {
      best = &line;
      continue;
    }
    const Sample& b = best->waiting[best->next];
    if (s.timed && (!b.timed || s.time < b.time)) best = &line;
  }
  return best;
}

void Recorder::put(Line& line, runtime::Clock::time_point now) {
  const Sample& s = line.waiting[line.next++];
  const bool clock = line.topic == &topics::kState || line.topic == &topics::kClock;
  if (s.timed && clock) now_ns_ = s.time;
  const std::uint64_t time = s.timed ? s.time : now_ns_;
  const auto sequence = static_cast<std::uint32_t>(line.recorded);
  if (file_->write(record::Message{line.channel, sequence, time, time, s.payload}, now)) ++line.recorded;
}

void Recorder::close() {
  if (closed_) return;
  closed_ = true;
  while (poll(runtime::Clock::now())) {
  }
  put_counters();
  if (!file_->close() && !told_) spdlog::error("{}", to_string(*problem()));
}

void Recorder::put_counters() {
  record::Metadata m{"counters", {}};
  for (const Line& line : lines_) {
    const auto c = line.reader->counters();
    m.entries.emplace_back(std::string(line.topic->name),
                           fmt::format("recorded {} lost {} refused {}", line.recorded, c.lost, c.refused));
  }
  file_->write(m);
}

int Recorder::topics_alive() const {
  return static_cast<int>(
      std::count_if(lines_.begin(), lines_.end(), [](const Line& l) { return l.reader->matched() > 0; }));
}

std::uint64_t Recorder::lost() const {
  std::uint64_t n = 0;
  for (const Line& line : lines_) n += line.reader->counters().lost + line.reader->counters().refused;
  return n;
}

std::string Recorder::report() const {
  const auto used = std::count_if(lines_.begin(), lines_.end(), [](const Line& l) { return l.recorded > 0; });
  std::string out = fmt::format("{:.1f} kB, {} messages of {} topics, {} lost",
                                static_cast<double>(file_->bytes()) / 1e3, file_->messages(), used, lost());
  if (file_->refused() > 0) out += fmt::format(", {} not written", file_->refused());
  return out;
}

Result<std::unique_ptr<Recorder>, Problem> open_recorder(bus::Node& node, const RunArgs& args,
                                                         const scene::Scene& scene, scene::Pace pace) {
  if (args.record_path.empty()) return std::unique_ptr<Recorder>();
  const auto compression = record::compression_from(args.compression);
  if (!compression) return compression.error();
  const auto place = [](const std::string& path) {
    std::error_code none;
    return std::filesystem::weakly_canonical(path, none);
  };
  const std::string stream = scene.perception.stream ? scene.perception.stream->path : "";
  for (const auto& [path, what] :
       {std::pair{stream, "the scene's obstacle stream"}, {args.csv_path, "the file of --csv"}})
    if (!path.empty() && place(path) == place(args.record_path))
      return Problem{"--record " + args.record_path, fmt::format("is {}", what)};
  return Recorder::open(node, {args.record_path, compression.value(), &scene, scene::to_string(pace)});
}

}  // namespace hamel::client
