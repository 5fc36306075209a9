/// hamel-dynamics: the arm of a scene as a service of its own.

#include "common/runtime/options.h"
#include "services/dynamics/service.h"

using namespace hamel;

int main(int argc, char** argv) {
  runtime::StopSignal stop;
  CLI::App app{"hamel-dynamics: integrates the arm of a scene and publishes its state"};
  runtime::RunOptions o;
  runtime::add_run_options(app, o);
  runtime::add_readers_option(app, o);
  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  runtime::start_log("hamel-dynamics", o.verbose);

  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel-dynamics", scene.error());
  auto node = runtime::open_node(o.bus, scene.value().bus.dynamics, "hamel-dynamics");
  if (!node) return runtime::complain("hamel-dynamics", {node.error()});

  const dynamics::ServiceConfig config{.pace = runtime::pace(o, scene::Pace::realtime),
                                       .endless = o.duration_s <= 0,
                                       .state_dir = o.state_dir};
  auto service = dynamics::DynamicsService::make(*node.value(), scene.value(), config);
  if (!service) return runtime::complain("hamel-dynamics", {service.error()});
  runtime::await_readers(*node.value(), *service.value(), o.readers, stop);
  runtime::Service* const services[] = {service.value().get()};
  runtime::run(*node.value(), services, *services[0], stop);
  runtime::linger(*node.value());

  switch (service.value()->outcome()) {
    case dynamics::Outcome::no_command:
      return runtime::kNoData;
    case dynamics::Outcome::diverged:
      return runtime::kFailed;
    default:
      return runtime::kDone;
  }
}
