#pragma once
/// Reactive planning measured on many scenes, methods side by side: `hamel bench planner`.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/bench_reduce.h"

namespace hamel::client {

struct BenchArgs {
  std::vector<std::string> families, methods;  ///< empty: all
  std::string problems_folder;                 ///< MoveIt's problems instead of random scenes; empty: none
  std::string streams_folder;                  ///< recorded obstacle streams instead; empty: none
  std::vector<int> spheres;                    ///< cells with these numbers of spheres; empty: all
  std::size_t scenes = 100;                    ///< of each cell
  std::uint64_t seed = 1;
  std::string model = "prototype";
  double dt_s = 0.002;
  double duration_s = 0;  ///< of a trial, at most; 0: the family's own
  bool velocities_unknown = false;
  double latency_s = 0, rate_hz = 0;
  bool dropout = false;  ///< the obstacle stream ends while the arm moves
  int best_of = 1;       ///< trials of a scene, the first that reaches counts
  int jobs = 0;          ///< threads; 0: one a processor
  std::vector<std::string> overrides;
  std::string csv_path, plot_path;
  bool json = false, check = false;
};

/// 0; 1 with `check` where something promised is missed; 2 bad input; 130 interrupted, with what was done
/// printed.
int bench_planner(const BenchArgs& args);

/// The verb `bench` with its options.
class BenchVerb {
 public:
  explicit BenchVerb(CLI::App& app);
  /// The exit code when the verb was asked for.
  std::optional<int> run() const;

 private:
  void add_scenes();
  void add_conditions();
  BenchArgs args_;
  BenchReduceArgs reduce_args_;
  CLI::App *planner_ = nullptr, *reduce_ = nullptr;
};

}  // namespace hamel::client
