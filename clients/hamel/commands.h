#pragma once
/// The verbs of the command line: each takes its options and returns the exit code.

#include <string>
#include <vector>

#include "common/runtime/options.h"

namespace hamel::client {

struct RunArgs {
  runtime::RunOptions run;
  bool json = false;
  std::string csv_path;
  std::string record_path, compression = "lz4";
};

/// All three services in this process.
int run(const RunArgs& args);
/// One supervised process a service.
int up(const RunArgs& args);

struct GoalArgs {
  runtime::BusOptions bus;
  std::uint32_t arm = 1;
  std::vector<double> position_m;  ///< 3, or
  std::vector<double> pose;        ///< 7: position, quaternion x y z w, or
  std::vector<double> joints;
};
int goal(const GoalArgs& args);

struct ModeArgs {
  runtime::BusOptions bus;
  std::uint32_t arm = 1;
  std::string mode;  ///< stop, hold, resume, clear-fault
};
int mode(const ModeArgs& args);

struct StatusArgs {
  runtime::BusOptions bus;
  double seconds = 1.5;
  bool json = false;
};
int status(const StatusArgs& args);

}  // namespace hamel::client
