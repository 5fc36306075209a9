/// hamel-perception: publishes the obstacles of a scene, scripted or from a recorded stream.

#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "services/perception/service.h"

using namespace hamel;

int main(int argc, char** argv) {
  runtime::StopSignal stop;
  CLI::App app{"hamel-perception: publishes the obstacles of a scene on the run's clock"};
  runtime::RunOptions o;
  runtime::add_run_options(app, o);
  runtime::add_readers_option(app, o);
  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  runtime::start_log("hamel-perception", o.verbose);

  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel-perception", scene.error());
  auto node = runtime::open_node(o.bus, scene.value().bus.perception, "hamel-perception");
  if (!node) return runtime::complain("hamel-perception", {node.error()});

  auto service = perception::PerceptionService::make(*node.value(), scene.value());
  if (!service) return runtime::complain("hamel-perception", service.error());
  runtime::await_readers(*node.value(), *service.value(), o.readers, stop);
  runtime::Service* const services[] = {service.value().get()};
  runtime::run(*node.value(), services, *services[0], stop);
  return runtime::kDone;
}
