#include "clients/hamel/outputs.h"

#include <filesystem>

namespace hamel::client {

std::optional<Problem> output_problem(const std::string& option, const std::string& path,
                                      const std::vector<std::string>& read) {
  namespace fs = std::filesystem;
  if (path.empty()) return {};
  std::error_code none;
  for (const std::string& r : read)
    if (!r.empty() && fs::equivalent(path, r, none) && !none)
      return Problem{option + " " + path, "would overwrite " + r + ", which is read"};
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder, none))
    return Problem{option + " " + path, "its folder " + folder.string() + " is not there"};
  return {};
}

}  // namespace hamel::client
