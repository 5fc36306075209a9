#include "clients/hamel/record.h"

#include <fmt/format.h>

#include "clients/hamel/recorder.h"
#include "common/files/scene_text.h"
#include "common/runtime/log.h"

namespace hamel::client {

using namespace std::chrono_literals;

namespace {

/// Says when the recording has begun: the writers that are there have been found, and no further one for a
/// moment.
class Announcer final : public runtime::Service {
 public:
  Announcer(const Recorder& recorder, const RecordArgs& args) : recorder_(recorder), args_(args) {}
  bool poll(runtime::Clock::time_point now) override {
    if (!began_) began_ = now;
    const int alive = recorder_.topics_alive();
    if (alive != alive_) {
      alive_ = alive;
      since_ = now;
    }
    if (!said_ && alive_ > 0 && now - since_ > 300ms) {
      said_ = true;
      fmt::print(stderr, "recording {}: {} topics have a writer\n", args_.path, alive_);
    }
    over_ = args_.duration_s > 0 && now - *began_ > std::chrono::duration<double>(args_.duration_s);
    return false;
  }
  runtime::Clock::time_point due() const override { return runtime::Clock::now() + 50ms; }
  bool finished() const override { return over_; }

 private:
  const Recorder& recorder_;
  const RecordArgs& args_;
  std::optional<runtime::Clock::time_point> began_;
  runtime::Clock::time_point since_{};
  int alive_ = 0;
  bool said_ = false, over_ = false;
};

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
  Announcer announcer(r, args);
  runtime::Service* const services[] = {&r, &announcer};
  const bool ended = runtime::run(n, services, announcer, stop);
  fmt::print(stderr, "{}: {}\n", args.path, r.report());
  if (r.problem()) return runtime::complain("hamel record", {*r.problem()});
  return ended && r.messages() == 0 ? runtime::kNoData : runtime::kDone;
}

}  // namespace hamel::client
