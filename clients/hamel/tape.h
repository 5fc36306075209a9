#pragma once
/// A recording of one run in memory, ready to be fed to a service again.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/scene/scene.h"
#include "common/wire/codec.h"

namespace hamel::client {

/// A message as it was recorded, with what the replay must know of it.
struct Recorded {
  const Topic* topic = nullptr;
  bus::Payload payload;
  std::uint64_t place = 0;  ///< in the order of the file
  std::uint64_t step = 0,
                incarnation = 0;  ///< state, command, report: incarnation of the arm; report: the epoch
  std::uint64_t epoch = 0, sequence = 0;  ///< command: the planner's; obstacles: sequence number; goal: id
  wire::Causes caused_by;
};

/// One arm's messages by topic, each in the order it was published.  Repeats (the same step said again to a
/// peer that came late) are left out.
struct Tape {
  std::optional<scene::Scene> scene;
  scene::Pace pace = scene::Pace::lockstep;
  std::vector<Recorded> states, commands, reports, obstacles, goals, modes;
  std::optional<wire::RunSummary> summary;  ///< the final one
};

struct TapeOptions {
  std::string path;
  std::string scene_path;  ///< empty: the scene in the recording
  std::vector<std::string> overrides;
  std::uint32_t arm = 0;  ///< 0: the scene's
};

/// Reads it all; fails with the reason where the file is damaged, holds no scene, or does not begin with the
/// run.
Checked<Tape> load_tape(const TapeOptions& options);

}  // namespace hamel::client
