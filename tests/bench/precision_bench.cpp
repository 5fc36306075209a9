// Accuracy against time of the tiers of high order, on example 5.1 and on three fast rods, in one run; and
// what energy is left after 1e4 s.  Each run goes from the start to the horizon; its time is that of the
// whole run, its error the distance of the end from a converged one.  No test asserts times;
// tests/bench/table writes the tables.
#include <benchmark/benchmark.h>

#include <cmath>
#include <functional>
#include <memory>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/dopri8.h"
#include "services/dynamics/core/gauss.h"
#include "services/dynamics/core/marcher.h"
#include "services/dynamics/core/rivals.h"
#include "tests/support/chains.h"

namespace hamel::dynamics {
namespace {

struct Motion {
  std::string name;
  model::Chain chain;
  double horizon_s, reference_dt_s;
};

/// One tier with its options, as the integrator would make it; gauss with SIMD registers of a given width.
struct Method {
  std::string name;
  Options options;
  Lanes lanes = Lanes::baseline;
};

int steps_of(double horizon_s, double dt_s) { return static_cast<int>(std::lround(horizon_s / dt_s)); }

class Run {
 public:
  Run(const model::Chain& chain, const Method& method)
      : options_(method.options), flat_(chain), load_(flat_.n()), marcher_(flat_, options_, tier(method)) {
    begin_ = marcher_.start(VectorXd::Zero(flat_.n()), VectorXd::Zero(flat_.n()));
    start_J_ = marcher_.energy(begin_);
  }
  /// From the start through so many steps; false when one was refused or divided.  The energy is looked at
  /// every 10 s, whatever the method's step.
  bool go(int steps) {
    const int each = std::max(1, steps_of(10, options_.dt_s));
    state_ = begin_;
    evaluations_ = 0, worst_J_ = 0;
    for (int k = 1; k <= steps; ++k) {
      const StepReport report = marcher_.step(state_, load_);
      evaluations_ += report.evaluations;
      if (!report.usable() || report.substeps != 1) return false;
      if (k % each == 0) worst_J_ = std::max(worst_J_, std::abs(marcher_.energy(state_) - start_J_));
    }
    return true;
  }
  const VectorXd& end() const { return state_.q; }
  double evaluations() const { return evaluations_; }
  double energy_error() const { return worst_J_ / flat_.energy_scale; }

 private:
  std::unique_ptr<TierStep<SE2>> tier(const Method& method) {
    if (options_.tier == Tier::gauss) return std::make_unique<GaussStep<SE2>>(flat_, options_, method.lanes);
    if (options_.tier == Tier::rk4) return std::make_unique<Rk4Step<SE2>>(flat_, options_);
    return std::make_unique<Dopri8Step<SE2>>(flat_, options_);
  }
  const Options options_;
  const rbd::PlanarChain flat_;
  Load<SE2> load_;
  Marcher<SE2> marcher_;
  State begin_, state_;
  double start_J_ = 0, evaluations_ = 0, worst_J_ = 0;
};

VectorXd reference(const Motion& m) {
  Run run(m.chain, {"", {.tier = Tier::gauss, .dt_s = m.reference_dt_s, .stages = 8}, Lanes::baseline});
  if (!run.go(steps_of(m.horizon_s, m.reference_dt_s))) std::abort();
  return run.end();
}

/// Times a run again and again.  `end` may be empty: no error is told.
void measure(benchmark::State& state, const Motion& m, const Method& method, double horizon_s,
             const VectorXd& end) {
  Run run(m.chain, method);
  const int steps = steps_of(horizon_s, method.options.dt_s);
  for (auto _ : state)
    if (!run.go(steps)) return state.SkipWithError("a step was refused or divided");
  state.counters["horizon_s"] = horizon_s;
  state.counters["evaluations_per_s"] = run.evaluations() / horizon_s;
  state.counters["energy_error"] = run.energy_error();
  if (end.size() > 0) state.counters["joint_error"] = (run.end() - end).lpNorm<Eigen::Infinity>();
}

void add(const std::string& what, const Motion& m, const Method& method, const std::string& setting,
         double horizon_s, const VectorXd& end, bool once) {
  const std::string title = what + " " + m.name + "/" + method.name + "/" + setting;
  auto* one = benchmark::RegisterBenchmark(title.c_str(), measure, m, method, horizon_s, end);
  if (once) one->Iterations(1)->Repetitions(3);
}

/// The steps a method is tried with: `longest` and shorter by 10^(1/per_decade), where they divide the
/// horizon.
std::vector<double> ladder(double horizon_s, double longest_s, int rungs, double per_decade = 8) {
  std::vector<double> dts;
  for (int k = 0; k < rungs; ++k) {
    const double dt_s = horizon_s / std::ceil(horizon_s / (longest_s * std::pow(10, -k / per_decade)) - 1e-9);
    if (dts.empty() || dt_s < dts.back()) dts.push_back(dt_s);
  }
  return dts;
}
std::string shown(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", x);
  return text;
}

std::vector<Method> gauss_methods() {
  const char* wide = widest_lanes() == Lanes::avx512 ? " AVX-512"
                     : widest_lanes() == Lanes::avx2 ? " AVX2"
                                                     : "";
  std::vector<Method> methods;
  for (const int stages : {4, 6, 8})
    for (const Lanes lanes : {Lanes::baseline, widest_lanes()}) {
      const bool narrow = lanes == Lanes::baseline;
      if (!narrow || *wide)
        methods.push_back({"gauss-" + std::to_string(stages) + (narrow ? " SSE2" : wide),
                           {.tier = Tier::gauss, .stages = stages},
                           lanes});
    }
  return methods;
}

void add_precision(const Motion& m, double gauss_dt_s, double rk4_dt_s) {
  const VectorXd end = reference(m);
  for (Method method : gauss_methods())
    for (const double dt_s : ladder(m.horizon_s, gauss_dt_s, 9)) {
      method.options.dt_s = dt_s;
      add("precision", m, method, shown(dt_s), m.horizon_s, end, false);
    }
  Method rk4{"rk4", {.tier = Tier::rk4}};
  for (const double dt_s : ladder(m.horizon_s, rk4_dt_s, 14)) {
    rk4.options.dt_s = dt_s;
    add("precision", m, rk4, shown(dt_s), m.horizon_s, end, false);
  }
  Method adaptive{"dopri8",
                  {.tier = Tier::dopri8, .dt_s = m.horizon_s}};  // no output on the way to disturb it
  for (int k = 16; k <= 52; k += 2) {
    adaptive.options.tolerance_rel = std::pow(10, -k / 4.0);
    add("precision", m, adaptive, shown(adaptive.options.tolerance_rel), m.horizon_s, end, false);
  }
}

/// Energy over 1e4 s.
void add_energy(const Motion& m, double gauss_dt_s) {
  constexpr double kHorizon_s = 1e4;
  for (Method method : gauss_methods()) {
    if (method.options.stages != 8) continue;
    for (const double dt_s : ladder(kHorizon_s, gauss_dt_s, 15, 24)) {
      method.options.dt_s = dt_s;
      add("energy", m, method, shown(dt_s), kHorizon_s, {}, true);
    }
  }
  Method adaptive{"dopri8", {.tier = Tier::dopri8, .dt_s = 10}};
  for (int k = 4; k <= 12; ++k) {
    adaptive.options.tolerance_rel = std::pow(10, -k);
    add("energy", m, adaptive, shown(adaptive.options.tolerance_rel), kHorizon_s, {}, true);
  }
}

}  // namespace
}  // namespace hamel::dynamics

int main(int argc, char** argv) {
  using hamel::dynamics::Motion;
  const Motion paper{"5.1", hamel::test::paper_5_1(), 100, 0.1},
      rods{"rods", hamel::test::fast_rods(), 3, 0.0025};
  hamel::dynamics::add_precision(paper, 1.25, 0.2);
  hamel::dynamics::add_precision(rods, 0.03, 0.005);
  hamel::dynamics::add_energy(paper, 1.25);
  hamel::dynamics::add_energy(rods, 0.025);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
