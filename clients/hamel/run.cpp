#include <fmt/format.h>

#include "clients/hamel/chosen.h"
#include "clients/hamel/commands.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/print.h"
#include "clients/hamel/recorder.h"
#include "common/runtime/log.h"
#include "services/dynamics/service.h"
#include "services/perception/service.h"
#include "services/planner/service.h"

namespace hamel::client {

namespace {

int conclude(const scene::Scene& scene, Monitor& monitor, bool interrupted, const RunArgs& args,
             const std::string& pace, const std::string& bus) {
  const Outcome o = monitor.outcome(interrupted);
  if (args.json)
    print_json(scene, o);
  else
    print_table(scene, o, pace, bus);
  if (const auto p = monitor.finish_csv()) return runtime::complain("hamel run", {*p});
  return o.exit_code;
}

}  // namespace

int run(const RunArgs& asked) {
  RunArgs args = asked;
  runtime::StopSignal stop;
  runtime::start_log("hamel", args.run.verbose);
  const auto scene = load_chosen(args.run);
  if (!scene) return runtime::complain("hamel run", scene.error());
  const scene::Scene& s = scene.value();
  for (const auto& w : scene::warnings(s)) spdlog::warn("{}: {}", args.run.scene_path, w);
  for (const auto& [option, path] : {std::pair{"--csv", args.csv_path}, {"--record", args.record_path}})
    if (const auto p = output_problem(option, path, {args.run.scene_path}))
      return runtime::complain("hamel run", {*p});
  auto node = runtime::open_node(args.run.bus, "inproc", "hamel-run");
  if (!node) return runtime::complain("hamel run", {node.error()});
  bus::Node& n = *node.value();
  const auto pace = runtime::pace(args.run, scene::Pace::lockstep);

  std::unique_ptr<CsvWriter> csv;
  if (!args.csv_path.empty()) {
    auto w = CsvWriter::open(args.csv_path, s.robot.chain.n(), s.steered);
    if (!w) return runtime::complain("hamel run", {w.error()});
    csv = std::move(w).value();
  }
  auto recorder = open_recorder(n, args, s, pace);  // before the services: nothing of them is missed
  if (!recorder) return runtime::complain("hamel run", {recorder.error()});
  auto arm = dynamics::DynamicsService::make(n, s, {.pace = pace, .state_dir = args.run.state_dir});
  if (!arm) return runtime::complain("hamel run", {arm.error()});
  auto perception = perception::PerceptionService::make(n, s);
  if (!perception) return runtime::complain("hamel run", perception.error());
  auto planner = planner::PlannerService::make(n, s, {.pace = pace, .state_dir = args.run.state_dir});
  if (!planner) return runtime::complain("hamel run", {planner.error()});
  Monitor monitor(n, s, pace, std::move(csv), !args.json);

  // Perception first: in lockstep its sets are there before the planner looks for them.
  std::vector<runtime::Service*> services{arm.value().get()};
  if (s.steered) services.insert(services.end(), {perception.value().get(), planner.value().get()});
  services.push_back(&monitor);
  if (recorder.value()) services.push_back(recorder.value().get());
  const bool ended = runtime::run(n, services, monitor, stop);
  monitor.poll(runtime::Clock::now());
  if (recorder.value() && !args.json)
    fmt::print(stderr, "{}: {}\n", args.record_path, recorder.value()->report());
  return conclude(s, monitor, !ended, args, scene::to_string(pace), bus::to_string(n.options().vendor));
}

}  // namespace hamel::client
