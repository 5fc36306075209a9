#pragma once
/// The main of every service: options, scenes, node, loop, exit code.

#include <functional>
#include <memory>
#include <string>

#include "common/runtime/loop.h"
#include "common/runtime/options.h"

namespace hamel::runtime {

/// How long the node of a service in lockstep stays awake for the answer (bus::NodeOptions::awake).
inline constexpr std::chrono::microseconds kLockstepAwake{50};

struct Program {
  std::string name;                             ///< "hamel-planner"
  std::string what;                             ///< one sentence for --help
  std::string scene::Buses::*vendor = nullptr;  ///< the scene's wish for the bus of this service
  /// The service for one scene.
  std::function<Checked<std::unique_ptr<Service>>(bus::Node&, const scene::Scene&, const RunOptions&)> make;
  std::function<void(CLI::App&)> add_options = {};  ///< more of its own; empty: none
  std::function<void(RunOptions&)> adjust = {};     ///< what these change of the others, once they are read
};

/// Runs one service for each scene named, all on one node and one thread, until all are finished, or a
/// signal; one that fails holds no other up.  Returns the exit code: the first that is not kDone.  Never
/// throws: what escapes is one line on stderr and kFailed.  Tells systemd when it is ready and that it lives,
/// where NOTIFY_SOCKET asks for it.
int serve(const Program& program, int argc, char** argv) noexcept;

}  // namespace hamel::runtime
