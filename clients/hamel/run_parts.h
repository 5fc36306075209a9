#pragma once
/// What `hamel run` and `hamel up` do alike.

#include <memory>
#include <string>

#include "clients/hamel/commands.h"
#include "clients/hamel/monitor.h"

namespace hamel::client {

/// The scene, with its warnings in the log, where the files that are to be written may be; else every
/// problem. What is chosen for it (load_chosen()) is added to the overrides.
Checked<scene::Scene> scene_to_run(RunArgs& args);

/// The table that --csv asks for; null where it does not.
Result<std::unique_ptr<CsvWriter>, Problem> open_csv(const RunArgs& args, const scene::Scene& scene);

/// Prints the outcome and finishes the table; returns the exit code.
int conclude(const std::string& verb, const RunArgs& args, const scene::Scene& scene, Monitor& monitor,
             const Outcome& outcome, scene::Pace pace, const std::string& bus);

}  // namespace hamel::client
