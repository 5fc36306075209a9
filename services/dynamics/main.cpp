/// hamel-dynamics: the arms of scenes as a service of their own.

#include "common/runtime/serve.h"
#include "services/dynamics/service.h"

using namespace hamel;

int main(int argc, char** argv) {
  using Made = Checked<std::unique_ptr<runtime::Service>>;
  const runtime::Program program{
      .name = "hamel-dynamics",
      .what = "integrates the arms of scenes and publishes their states",
      .vendor = &scene::Buses::dynamics,
      .make = [](bus::Node& node, const scene::Scene& scene, const runtime::RunOptions& o) -> Made {
        auto made = dynamics::DynamicsService::make(node, scene,
                                                    {.pace = runtime::pace(o, scene::Pace::realtime),
                                                     .endless = o.duration_s <= 0,
                                                     .state_dir = o.state_dir});
        if (!made) return Problems{made.error()};
        return std::unique_ptr<runtime::Service>(std::move(made).value());
      }};
  return runtime::serve(program, argc, argv);
}
