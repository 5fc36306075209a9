#include <fmt/format.h>

#include "clients/hamel/recorder.h"
#include "clients/hamel/run_parts.h"
#include "common/runtime/log.h"
#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/service.h"

namespace hamel::client {

int run(const RunArgs& asked) {
  RunArgs args = asked;
  runtime::StopSignal stop;
  runtime::start_log("hamel", args.run.verbose);
  const auto scene = scene_to_run(args);
  if (!scene) return runtime::complain("hamel run", scene.error());
  const scene::Scene& s = scene.value();
  auto node = runtime::open_node(args.run.bus, "inproc", "hamel-run");
  if (!node) return runtime::complain("hamel run", {node.error()});
  bus::Node& n = *node.value();
  const auto pace = runtime::pace(args.run, scene::Pace::lockstep);

  auto csv = open_csv(args, s);
  if (!csv) return runtime::complain("hamel run", {csv.error()});
  auto recorder = open_recorder(n, args, s, pace);  // before the services: nothing of them is missed
  if (!recorder) return runtime::complain("hamel run", {recorder.error()});
  auto arm = dynamics::DynamicsService::make(n, s, {.pace = pace, .state_dir = args.run.state_dir});
  if (!arm) return runtime::complain("hamel run", {arm.error()});
  auto perception = perception::PerceptionService::make(n, s);
  if (!perception) return runtime::complain("hamel run", perception.error());
  auto planner = planner::PlannerService::make(n, s, {.pace = pace, .state_dir = args.run.state_dir});
  if (!planner) return runtime::complain("hamel run", {planner.error()});
  Monitor monitor(n, s, pace, std::move(csv).value(), !args.json);

  // Perception first: in lockstep its sets are there before the planner looks for them.
  std::vector<runtime::Service*> services{arm.value().get()};
  if (s.steered) services.insert(services.end(), {perception.value().get(), planner.value().get()});
  services.push_back(&monitor);
  if (recorder.value()) services.push_back(recorder.value().get());
  const bool ended = runtime::run(n, services, monitor, stop);
  monitor.poll(runtime::Clock::now());
  if (recorder.value() && !args.json)
    fmt::print(stderr, "{}: {}\n", args.record_path, recorder.value()->report());
  return conclude("hamel run", args, s, monitor, monitor.outcome(!ended), pace,
                  bus::to_string(n.options().vendor));
}

}  // namespace hamel::client
