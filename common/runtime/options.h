#pragma once
/// What every service and the client understand on their command lines, read one way.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/bus/bus.h"
#include "common/runtime/realtime.h"
#include "common/scene/scene.h"

namespace hamel::runtime {

/// Exit codes of every program here.
enum Exit : int {
  kDone = 0,           ///< done, or an asked-for end
  kFailed = 1,         ///< STUCK, UNSAFE, FAULT, contact, failed check
  kBadInput = 2,       ///< bad input or usage
  kNoData = 3,         ///< not reached in time, no data, no peer
  kInterrupted = 130,  ///< an interrupted job
};

/// Options of the bus: which vendor, where, with whom.
struct BusOptions {
  std::string vendor;  ///< empty: the program's default
  std::uint32_t domain = bus::NodeOptions{}.domain;
  std::string interface_name;
  std::vector<std::string> peers;
  std::string discovery_server;        ///< Fast DDS only
  std::string security;                ///< folder of an identity
  std::chrono::microseconds awake{0};  ///< bus::NodeOptions::awake; no option sets it
};

/// Options of a run of a scene.
struct RunOptions {
  BusOptions bus;
  std::string scene_path;
  std::vector<std::string> overrides;       ///< --set path=value
  bool lockstep = false, realtime = false;  ///< at most one; neither: the program's default
  double duration_s = -1;                   ///< < 0: the scene's, or for a lone service: until told to end
  std::string state_dir;                    ///< checkpoints; empty: none
  RealtimeOptions realtime_options;
  std::vector<std::string> more_scenes;  ///< a lone service: other arms in the same process
  std::uint32_t strength = 0;            ///< a lone planner: the stronger of two drives the arm
  int readers = 0;                       ///< a lone service: begin when its topics have so many readers
  bool verbose = false;
};

void add_bus_options(CLI::App& app, BusOptions& o);
void add_run_options(CLI::App& app, RunOptions& o);
/// Of a service in its own process.
void add_service_options(CLI::App& app, RunOptions& o);
/// The bus and real-time options as a service's command line takes them.
void append(const BusOptions& o, std::vector<std::string>& command);
void append(const RealtimeOptions& o, std::vector<std::string>& command);

/// The scene of these options, or every problem.  A --duration replaces the scene's.
Checked<scene::Scene> load(const RunOptions& o);
scene::Pace pace(const RunOptions& o, scene::Pace otherwise);
/// A node of these options, or its one problem.  The vendor is the one of --bus, else the scene's for this
/// service, else the network default.
Result<std::unique_ptr<bus::Node>, Problem> open_node(const BusOptions& o, const std::string& scene_vendor,
                                                      const std::string& name);

/// Checks of numbers on a command line.  CLI11's own let NaN pass and spell out limits with 309 digits.
CLI::Validator finite();
/// In (0, 1e9]: a time, a rate, a tolerance.
CLI::Validator positive();
/// In [low, high].
CLI::Validator between(double low, double high);

/// Prints every problem to stderr as "program: where: what" and returns kBadInput.
int complain(const std::string& program, const Problems& problems);

/// Parses; on --help, --version or a usage error prints and returns the exit code.
std::optional<int> parse(CLI::App& app, int argc, char** argv);

/// "hamel 0.1.0 (idl 0123456789abcdef)"
std::string version();

}  // namespace hamel::runtime
