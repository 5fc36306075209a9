/// hamel-planner: steers the arms of scenes.

#include "common/runtime/serve.h"
#include "services/planner/service.h"

using namespace hamel;

int main(int argc, char** argv) {
  using Made = Checked<std::unique_ptr<runtime::Service>>;
  const runtime::Program program{
      .name = "hamel-planner",
      .what = "steers arms to their goals past the obstacles",
      .vendor = &scene::Buses::planner,
      .make = [](bus::Node& node, const scene::Scene& scene, const runtime::RunOptions& o) -> Made {
        auto made = planner::PlannerService::make(node, scene,
                                                  {.pace = runtime::pace(o, scene::Pace::realtime),
                                                   .state_dir = o.state_dir,
                                                   .strength = o.strength});
        if (!made) return Problems{made.error()};
        return std::unique_ptr<runtime::Service>(std::move(made).value());
      }};
  return runtime::serve(program, argc, argv);
}
