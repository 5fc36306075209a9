#pragma once
/// Many variations of a scene on all cores: `hamel batch`.

#include <string>
#include <vector>

namespace hamel::client {

struct BatchArgs {
  std::string path;        ///< what to vary: .textproto or .csv
  std::string scene_path;  ///< empty: the one that the file names
  std::vector<std::string> overrides;
  std::string out_path;  ///< CSV; empty: none, and nothing to go on from
  int workers = 0;       ///< 0: one a core
};
/// 0 when every variation was run, however it ended; 2 bad input, also where a variation is no valid scene;
/// 130 interrupted: the same command goes on where it stopped.
int batch(const BatchArgs& args);

}  // namespace hamel::client
