#include "clients/hamel/run_parts.h"

#include "clients/hamel/chosen.h"
#include "clients/hamel/outputs.h"
#include "clients/hamel/print.h"
#include "common/runtime/log.h"

namespace hamel::client {

Checked<scene::Scene> scene_to_run(RunArgs& args) {
  auto scene = load_chosen(args.run);
  if (!scene) return scene;
  for (const auto& w : scene::warnings(scene.value())) spdlog::warn("{}: {}", args.run.scene_path, w);
  for (const auto& [option, path] : {std::pair{"--csv", args.csv_path}, {"--record", args.record_path}})
    if (const auto p = output_problem(option, path, {args.run.scene_path})) return Problems{*p};
  return scene;
}

Result<std::unique_ptr<CsvWriter>, Problem> open_csv(const RunArgs& args, const scene::Scene& scene) {
  if (args.csv_path.empty()) return std::unique_ptr<CsvWriter>();
  return CsvWriter::open(args.csv_path, scene.robot.chain.n(), scene.steered);
}

int conclude(const std::string& verb, const RunArgs& args, const scene::Scene& scene, Monitor& monitor,
             const Outcome& outcome, scene::Pace pace, const std::string& bus) {
  if (args.json)
    print_json(scene, outcome);
  else
    print_table(scene, outcome, scene::to_string(pace), bus);
  if (const auto p = monitor.finish_csv()) return runtime::complain(verb, {*p});
  return outcome.exit_code;
}

}  // namespace hamel::client
