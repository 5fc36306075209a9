#pragma once
/// The paper's figures of a free motion, drawn again: `hamel figures`.

#include <string>
#include <vector>

namespace hamel::client {

struct FiguresArgs {
  std::string scene_path;
  std::vector<std::string> overrides;
  std::string folder;  ///< made when absent
};
/// Writes into `folder`, each as .csv, .svg and .png:
///   figure3  paths of the links' centres of mass, by the paper's own integrator, Eqs. (9), (13), (16)
///   figure4  height of the end effector against semi-implicit Euler, and how far each is from the truth
///   figure5  iterations and residual of every step
int figures(const FiguresArgs& args);

}  // namespace hamel::client
