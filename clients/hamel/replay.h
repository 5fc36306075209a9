#pragma once
/// Feeds a recording to a service and compares what comes out with what was recorded.

#include <string>
#include <vector>

namespace hamel::client {

struct ReplayArgs {
  std::string path, into, scene_path;
  std::vector<std::string> overrides, tolerances;
  bool check = false, json = false;
};
int replay(const ReplayArgs& args);

}  // namespace hamel::client
