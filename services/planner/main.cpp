/// hamel-planner: steers the arm of a scene, as a service of its own.

#include "common/runtime/options.h"
#include "services/planner/service.h"

using namespace hamel;

int main(int argc, char** argv) {
  runtime::StopSignal stop;
  CLI::App app{"hamel-planner: steers an arm to its goal past the obstacles"};
  runtime::RunOptions o;
  runtime::add_run_options(app, o);
  runtime::add_readers_option(app, o);
  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  runtime::start_log("hamel-planner", o.verbose);

  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel-planner", scene.error());
  auto node = runtime::open_node(o.bus, scene.value().bus.planner, "hamel-planner");
  if (!node) return runtime::complain("hamel-planner", {node.error()});

  const planner::ServiceConfig config{.pace = runtime::pace(o, scene::Pace::realtime),
                                      .state_dir = o.state_dir};
  auto service = planner::PlannerService::make(*node.value(), scene.value(), config);
  if (!service) return runtime::complain("hamel-planner", {service.error()});
  runtime::await_readers(*node.value(), *service.value(), o.readers, stop);
  runtime::Service* const services[] = {service.value().get()};
  runtime::run(*node.value(), services, *services[0], stop);
  return runtime::kDone;
}
