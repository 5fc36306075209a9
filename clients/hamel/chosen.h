#pragma once
/// Scenes for those who may run them: reduced, and with tier and step where the scene leaves these to us.

#include "common/runtime/options.h"

namespace hamel::client {

/// runtime::load(); where the scene's fidelity asks for it, tier and step are then chosen (choose.h), said in
/// the log, and added to `o.overrides`, so that child processes and recordings take the same ones.
Checked<scene::Scene> load_chosen(runtime::RunOptions& o);
/// The same in silence, for one of many scenes; for several threads at once.
Checked<scene::Scene> load_chosen(const std::string& path, const std::vector<std::string>& overrides);

}  // namespace hamel::client
