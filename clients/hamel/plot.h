#pragma once
/// A picture of a run: where the arm went and how close it came, drawn by gnuplot.

#include <string>
#include <vector>

namespace hamel::client {

struct PlotArgs {
  std::string scene_path;
  std::vector<std::string> overrides;
  std::string csv_path;  ///< written by --csv of the same scene
  std::string out_path;  ///< .svg or .png
};

int plot(const PlotArgs& args);

}  // namespace hamel::client
