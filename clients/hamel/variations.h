#pragma once
/// Variations of a scene: which there are, and what came of one.

#include <cstddef>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/files/batch_text.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// Fields that vary and, for each variation, their values.  Pure: the same file gives the same ones.
class Variations {
 public:
  /// The grid, the last field fastest; or random ones, each drawn from seed and number alone.
  explicit Variations(files::BatchText text);
  /// A table: field paths in the first line, a variation in each other.
  static Checked<Variations> from_csv(const std::string& path);

  std::size_t size() const noexcept { return size_; }
  const std::vector<std::string>& fields() const noexcept { return fields_; }
  const std::string& scene_path() const noexcept { return text_.scene_path; }
  const std::vector<std::string>& set() const noexcept { return text_.set; }
  /// Values of variation i, as text, one a field.
  std::vector<std::string> values(std::size_t i) const;
  /// The same as overrides, "field=value".
  std::vector<std::string> overrides(std::size_t i) const;

 private:
  Variations() = default;
  files::BatchText text_;
  std::vector<std::string> fields_;
  std::vector<std::vector<std::string>> rows_;  ///< of a table
  std::size_t size_ = 0;
};

/// What a run of one variation came to; numbers that do not depend on the machine's load.
struct VariationResult {
  std::string outcome;  ///< DONE, REACHED, MOVING, STUCK, UNSAFE, FAULT, DIVERGED, BAD_INPUT
  std::string reason;
  double time_to_goal_s = -1, final_error_m = 0, clearance_m = 0, path_length_m = 0, energy_drift_rel = 0;
  std::uint64_t contacts = 0, steps = 0;
  std::string hash;  ///< that of hamel run
};

/// A lockstep run of a scene.
VariationResult run_variation(const scene::Scene& scene);
/// Names of a result's columns, and the columns, as CSV; no end of line.
std::string result_header();
std::string to_csv(const VariationResult& r);

}  // namespace hamel::client
