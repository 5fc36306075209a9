#include <fmt/format.h>

#include <filesystem>

#include "clients/hamel/recorder.h"
#include "clients/hamel/run_folder.h"
#include "clients/hamel/run_parts.h"
#include "clients/hamel/supervisor.h"
#include "common/runtime/log.h"

namespace hamel::client {

using namespace std::chrono_literals;

namespace {

constexpr auto kLook = 300ms;
constexpr auto kLastWords = 2s;  // of dynamics, after it has ended

/// The clock of an arm of this key that runs already; waits a moment, for a match takes one.
std::optional<wire::SimulationClock> other_arm(bus::Node& node, std::uint32_t arm) {
  wire::Subscription<wire::SimulationClock> clocks(node, bus::Ask::glimpse);
  const auto deadline = runtime::Clock::now() + kLook;
  wire::SimulationClock c;
  do {
    while (clocks.take(c))
      if (c.arm == arm && c.running) return c;
  } while (node.wait(deadline) || runtime::Clock::now() < deadline);
  return {};
}

/// The supervisor as part of the loop.
class Children final : public runtime::Service {
 public:
  Children(Supervisor& supervisor, Monitor& monitor) : supervisor_(supervisor), monitor_(monitor) {}
  bool poll(runtime::Clock::time_point now) override {
    if (now < look_) return false;  // not with every message: it asks the kernel for each child
    look_ = now + 5ms;
    supervisor_.poll(now);
    monitor_.restarts(supervisor_.restarts());
    if (supervisor_.ended() && ended_ == runtime::Clock::time_point{}) ended_ = now;
    over_ = ended_ != runtime::Clock::time_point{} && now - ended_ > kLastWords;
    return false;
  }
  runtime::Clock::time_point due() const override { return runtime::Clock::now() + 20ms; }
  /// The planner goes on talking when dynamics has ended: its last words may be lost, the others are no
  /// answer.
  bool finished() const override { return monitor_.finished() || over_ || supervisor_.failed() != nullptr; }

 private:
  Supervisor& supervisor_;
  Monitor& monitor_;
  runtime::Clock::time_point look_{}, ended_{};
  bool over_ = false;
};

std::vector<std::string> command(const std::string& service, const RunArgs& a, const scene::Scene& s,
                                 scene::Pace pace, const std::string& state_dir) {
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  const auto beside = here / ("hamel-" + service);
  std::vector<std::string> c{beside.string(), a.run.scene_path};
  for (const auto& o : a.run.overrides) c.insert(c.end(), {"--set", o});
  c.push_back(pace == scene::Pace::lockstep ? "--lockstep" : "--realtime");
  c.insert(c.end(), {"--duration", fmt::format("{}", s.duration_s), "--state-dir", state_dir});
  runtime::append(a.run.bus, c);
  runtime::append(a.run.realtime_options, c);
  if (a.run.verbose) c.push_back("--verbose");
  // The recorder is to hear everything from the first word on: it, the monitor and the other services.
  if (!a.record_path.empty())
    c.insert(c.end(), {"--readers", service == "dynamics" && s.steered ? "3" : "2"});
  return c;
}

}  // namespace

namespace {

/// "cyclonedds", or "fastdds + cyclonedds" where the services differ.
std::string buses(const RunArgs& args, const scene::Scene& s) {
  std::string all;
  for (const std::string& of : {s.bus.dynamics, s.bus.planner, s.bus.perception}) {
    std::string name = !args.run.bus.vendor.empty() ? args.run.bus.vendor : of;
    if (name.empty()) name = bus::to_string(bus::kDefaultNetworkVendor);
    if (all.find(name) == std::string::npos) all += (all.empty() ? "" : " + ") + name;
  }
  return all;
}

}  // namespace

int up(const RunArgs& asked) {
  RunArgs args = asked;
  runtime::StopSignal stop;
  runtime::start_log("hamel", args.run.verbose);
  const auto scene = scene_to_run(args);
  if (!scene) return runtime::complain("hamel up", scene.error());
  const scene::Scene& s = scene.value();
  auto node = runtime::open_node(args.run.bus, s.bus.dynamics, "hamel-up");
  if (!node) return runtime::complain("hamel up", {node.error()});
  bus::Node& n = *node.value();
  if (n.options().vendor == bus::Vendor::inproc)
    return runtime::complain(
        "hamel up", {{"--bus inproc", "reaches one process only; use fastdds or cyclonedds, or hamel run"}});
  const auto pace = runtime::pace(args.run, scene::Pace::realtime);
  if (const auto there = other_arm(n, s.arm))
    return runtime::complain(
        "hamel up",
        {{fmt::format("arm {}", s.arm),
          fmt::format("runs already on domain {} (t = {:.3f} s): another --domain, or --set arm={}",
                      args.run.bus.domain, there->t_s, s.arm + 1)}});

  auto csv = open_csv(args, s);
  if (!csv) return runtime::complain("hamel up", {csv.error()});
  std::unique_ptr<RunFolder> folder;
  std::string state_dir = args.run.state_dir;
  if (state_dir.empty()) {
    auto f = RunFolder::make();
    if (!f) return runtime::complain("hamel up", {f.error()});
    folder = std::move(f).value();
    state_dir = folder->path();
  } else if (std::error_code e; !std::filesystem::is_directory(state_dir) &&
                                !std::filesystem::create_directories(state_dir, e)) {
    return runtime::complain("hamel up", {{state_dir, "cannot make the folder: " + e.message()}});
  }

  auto recorder = open_recorder(n, args, s, pace);
  if (!recorder) return runtime::complain("hamel up", {recorder.error()});
  Monitor monitor(n, s, pace, std::move(csv).value(), !args.json);
  Supervisor supervisor;
  if (s.steered)
    for (const char* name : {"perception", "planner"})
      supervisor.add(name, command(name, args, s, pace, state_dir), false);
  supervisor.add("dynamics", command("dynamics", args, s, pace, state_dir), true);
  Children children(supervisor, monitor);
  std::vector<runtime::Service*> services{&children, &monitor};
  if (recorder.value()) services.push_back(recorder.value().get());
  const bool ended = runtime::run(n, services, children, stop);
  const Supervisor::Child* failed = supervisor.failed();
  const int failed_code = failed ? failed->exit_code : 0;
  supervisor.end();

  if (recorder.value() && !args.json)
    fmt::print(stderr, "{}: {}\n", args.record_path, recorder.value()->report());
  const Outcome o = monitor.outcome(!ended);
  if (failed && !monitor.finished()) {
    spdlog::error("{} cannot run; ending", failed->name);
    return failed_code == runtime::kBadInput ? runtime::kBadInput : runtime::kFailed;
  }
  if (supervisor.restarts() > 0) spdlog::info("{} restarts", supervisor.restarts());
  return conclude("hamel up", args, s, monitor, o, pace, buses(args, s));
}

}  // namespace hamel::client
