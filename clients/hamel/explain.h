#pragma once
/// What a scene requires, what was left out, and what that bought: `hamel explain`.

#include <string>
#include <vector>

namespace hamel::client {

struct ExplainArgs {
  std::vector<std::string> scene_paths;  ///< one; or several with `table`
  std::vector<std::string> overrides;
  bool json = false;
  bool table = false;    ///< speed against accuracy, a row for each fidelity of each scene (Markdown)
  double seconds = 0.3;  ///< CPU time for each measurement of cost
};
/// 0; 1 where a table's scene has no setting that keeps to its accuracy; 2 bad input.
int explain(const ExplainArgs& args);

}  // namespace hamel::client
