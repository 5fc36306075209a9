#pragma once
/// The verbs about recordings.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "common/runtime/options.h"

namespace hamel::client {

struct RecordArgs {
  runtime::BusOptions bus;
  std::string path, compression = "lz4", scene_path;
  std::vector<std::string> overrides;
  double duration_s = -1;
};
/// Records the bus until told to end.
int record(const RecordArgs& args);

struct LogArgs {
  std::string path, out_path, topic, compression = "lz4";
  double begin_s = 0, end_s = -1;  ///< log time; end < 0: to the end
  bool json = false;
};
int log_info(const LogArgs& args);
int log_cat(const LogArgs& args);
int log_csv(const LogArgs& args);
int log_recover(const LogArgs& args);

/// A time of the command line [s] in the nanoseconds of a recording; before its beginning: 0.
inline std::uint64_t ns(double t_s) {
  return static_cast<std::uint64_t>(std::llround(std::max(0.0, t_s) * 1e9));
}

struct PlayArgs {
  runtime::BusOptions bus;
  std::string path;
  std::vector<std::string> topics{"obstacles"};
  double rate = 1, begin_s = 0, end_s = -1;
  bool loop = false;
  bool control = false, paused = false;  ///< commands come from standard input; begin standing still
  std::uint32_t arm = 1;                 ///< source of the sets made from a CSV
};
/// Puts recorded messages on the bus again, byte for byte, at the times of their recording; of a CSV, a set a
/// time.
int play(const PlayArgs& args);

/// The topic of a full or a short name ("state"); null: there is none.
const Topic* find_topic(const std::string& name);

}  // namespace hamel::client
