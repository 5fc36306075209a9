#pragma once
/// Variations of a scene as a file: protobuf text format (scene.proto, message Batch).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::files {

/// One field that varies: values as --set takes them, or numbers of a range.
struct Vary {
  std::string field;
  std::vector<std::string> values;
  std::optional<double> from, to;
  std::uint32_t count = 0;
};

struct BatchText {
  std::string scene_path;  ///< empty: not named; else as found
  std::vector<Vary> vary;
  std::uint32_t random = 0;  ///< 0: the grid
  std::uint64_t seed = 1;
  std::vector<std::string> set;
};

/// What the file holds, or every problem with line and column.  A `vary` has values, or from, to and, in a
/// grid, a count >= 2; a grid has at most 1e7 variations.
Checked<BatchText> load_batch(const std::string& path);

}  // namespace hamel::files
