#pragma once
/// Accuracy against cost on one's own scene, measured: `hamel trade`.

#include <string>
#include <vector>

namespace hamel::client {

struct TradeArgs {
  std::string scene_path;  ///< scene, or a robot's URDF
  std::vector<std::string> overrides;
  std::string csv_path, plot_path;  ///< empty: none
  double horizon_s = 0;             ///< 0: the scene's duration
  double tick_s = 0;                ///< control tick, the longest step tried; 0: any
  double accuracy = 0;              ///< joint error to recommend for [rad or m]; 0: no recommendation
  std::string by = "time";          ///< what counts as cost: time or evaluations
  bool quick = false;               ///< fewer candidates
  int jobs = 1;                     ///< threads; with more than one their times are worth less
};
/// 0; 1 when nothing measured meets the accuracy; 2 bad input; 130 interrupted.
int trade(const TradeArgs& args);

}  // namespace hamel::client
