#pragma once
/// Pictures of a run, drawn by gnuplot.

#include <string>
#include <vector>

namespace hamel::client {

struct PlotArgs {
  std::string path;        ///< recording, or what --csv wrote
  std::string scene_path;  ///< of a CSV; empty: the end effector alone is drawn
  std::vector<std::string> overrides;
  std::vector<std::string>
      kinds;             ///< path, clearance, energy, iterations, latencies; empty: what suits the run
  std::string out_path;  ///< .svg or .png
};

int plot(const PlotArgs& args);

}  // namespace hamel::client
