#include "clients/hamel/record.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "clients/hamel/recorder.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"

namespace hamel::client {

using namespace std::chrono_literals;

namespace {

/// A message waits so long at most; waking up for each would cost more than writing it.
constexpr auto kRound = 20ms;

/// Says when the recording has begun: the writers that are there have been found, and no further one for a
/// moment.
class Announcer {
 public:
  Announcer(const Recorder& recorder, const RecordArgs& args) : recorder_(recorder), args_(args) {}
  void poll(runtime::Clock::time_point now) {
    const int alive = recorder_.topics_alive();
    if (alive != alive_) {
      alive_ = alive;
      since_ = now;
    }
    if (!said_ && alive_ > 0 && now - since_ > 300ms) {
      said_ = true;
      fmt::print(stderr, "recording {}: {} topics have a writer\n", args_.path, alive_);
    }
  }

 private:
  const Recorder& recorder_;
  const RecordArgs& args_;
  runtime::Clock::time_point since_{};
  int alive_ = 0;
  bool said_ = false;
};

/// Until the time is over (true) or a stop was asked for (false).
bool keep(Recorder& recorder, const RecordArgs& args, const runtime::StopSignal& stop) {
  Announcer announcer(recorder, args);
  const auto began = runtime::Clock::now();
  const auto over = [&] {
    return args.duration_s > 0 &&
           runtime::Clock::now() - began > std::chrono::duration<double>(args.duration_s);
  };
  for (auto next = began; !stop.requested() && !over(); std::this_thread::sleep_until(next)) {
    const auto now = runtime::Clock::now();
    while (recorder.poll(now)) {
    }
    announcer.poll(now);
    next = std::max(next + kRound, now);
  }
  recorder.close();
  return !stop.requested();
}

}  // namespace

int record(const RecordArgs& args) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  const auto compression = record::compression_from(args.compression);
  if (!compression) return runtime::complain("hamel record", {compression.error()});
  std::optional<scene::Scene> scene;
  if (!args.scene_path.empty()) {
    auto s = files::load_scene(args.scene_path, args.overrides);
    if (!s) return runtime::complain("hamel record", s.error());
    scene = std::move(s).value();
  }
  auto node = runtime::open_node(args.bus, "", "hamel-record");
  if (!node) return runtime::complain("hamel record", {node.error()});
  bus::Node& n = *node.value();
  if (n.options().vendor == bus::Vendor::inproc)
    return runtime::complain("hamel record",
                             {{"--bus inproc", "reaches this process only; use hamel run --record"}});
  auto recorder = Recorder::open(n, {args.path, compression.value(), scene ? &*scene : nullptr, ""});
  if (!recorder) return runtime::complain("hamel record", {recorder.error()});
  Recorder& r = *recorder.value();
  fmt::print(stderr, "waiting for writers on {} domain {}\n", bus::to_string(n.options().vendor),
             args.bus.domain);
  const bool ended = keep(r, args, stop);
  fmt::print(stderr, "{}: {}\n", args.path, r.report());
  if (r.problem()) return runtime::complain("hamel record", {*r.problem()});
  return ended && r.messages() == 0 ? runtime::kNoData : runtime::kDone;
}

}  // namespace hamel::client
