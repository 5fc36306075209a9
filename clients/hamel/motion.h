#pragma once
/// What the verbs that compute a free motion share: the scene or plain robot, and Ctrl-C.

#include <functional>
#include <string>
#include <vector>

#include "common/runtime/signals.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// Reads `path`, a scene (.textproto) or a robot (.urdf, falling from rest), and calls `work` with it; the
/// work asks the signal now and then whether to end.  Returns the work's code; 2 where the file is wrong, 130
/// where it was interrupted.
int on_motion(const std::string& program, const std::string& path, const std::vector<std::string>& overrides,
              const std::function<int(const scene::Scene&, const runtime::StopSignal&)>& work);

}  // namespace hamel::client
