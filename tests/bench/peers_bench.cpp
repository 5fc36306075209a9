// What an arm costs here and in other libraries, in one run: forward dynamics, inverse dynamics, one step.
// Each is given the same chain of revolute joints and the same state; contacts, limits, constraints and
// sensors are off.  Times are for ratios within one run; no test asserts them.  tests/bench/table runs it and
// writes the table.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/peers/peer.h"
#include "tests/support/chains.h"

namespace hamel {
namespace {

using dynamics::Options;
using Eigen::VectorXd;
using scene::Root;
using scene::Tier;

constexpr int kJoints[] = {3, 7, 30, 100, 300, 1000};
constexpr double kEnd_s = 1;  // steps begin again after so much simulated time

struct Given {
  VectorXd q, qd, tau;
};

struct Arm {
  explicit Arm(int joints) : n(joints), chain(test::checked(test::hanging(joints))), states{} {
    for (Given& s : states)
      s = {rng.vector(n, std::min(0.1, 0.7 / n)), rng.vector(n, 0.5), rng.vector(n, 0.5)};
  }
  /// Another state each time: some libraries keep what an unchanged one gave.
  const Given& next() { return states[static_cast<std::size_t>(turn++ % 8)]; }
  int n;
  test::Random rng{1};
  model::Chain chain;
  std::array<Given, 8> states;
  unsigned turn = 0;
};

void our_forward(benchmark::State& state, int n) {
  Arm arm(n);
  rbd::Workspace ws(arm.chain);
  VectorXd out(n);
  for (auto _ : state) {
    const Given& s = arm.next();
    rbd::forward_dynamics(arm.chain, s.q, s.qd, s.tau, ws, out);
    benchmark::DoNotOptimize(out.data());
  }
}

void our_inverse(benchmark::State& state, int n) {
  Arm arm(n);
  rbd::Workspace ws(arm.chain);
  VectorXd out(n);
  for (auto _ : state) {
    const Given& s = arm.next();
    rbd::inverse_dynamics(arm.chain, s.q, s.qd, s.tau, ws, out);
    benchmark::DoNotOptimize(out.data());
  }
}

void step(benchmark::State& state, const model::Chain& chain, const VectorXd& q, const Options& options) {
  const int n = chain.n();
  dynamics::Integrator integrator(chain, options);
  const dynamics::State begin = integrator.start(q, VectorXd::Zero(n));
  const VectorXd tau = VectorXd::Zero(n);
  dynamics::State s = begin;
  double evaluations = 0, steps = 0;
  for (auto _ : state) {
    if (static_cast<double>(s.step) * options.dt_s >= kEnd_s) s = begin;
    const dynamics::StepReport report = integrator.step(s, tau);
    if (!report.usable()) return state.SkipWithError("step refused");
    evaluations += report.evaluations, ++steps;
  }
  state.counters["evaluations"] = evaluations / steps;
}

void our_step(benchmark::State& state, int n, const Options& options) {
  Arm arm(n);
  step(state, arm.chain, arm.next().q, options);
}

/// A planar arm of links of 0.1 m that falls: on SE(2), or as any arm.
void planar_step(benchmark::State& state, int n, const Options& options) {
  step(state, test::checked(test::planar(n, 1, 0.1, 0.01)), VectorXd::Zero(n), options);
}

void peer_forward(benchmark::State& state, int n, const peers::Maker& maker) {
  Arm arm(n);
  const auto peer = maker.make(arm.chain);
  VectorXd out(n);
  for (auto _ : state) {
    const Given& s = arm.next();
    peer->forward_dynamics(s.q, s.qd, s.tau, out);
  }
}

void peer_inverse(benchmark::State& state, int n, const peers::Maker& maker) {
  Arm arm(n);
  const auto peer = maker.make(arm.chain);
  VectorXd out(n);
  for (auto _ : state) {
    const Given& s = arm.next();
    peer->inverse_dynamics(s.q, s.qd, s.tau, out);
  }
}

void peer_step(benchmark::State& state, int n, const peers::Maker& maker, const std::string& stepper,
               double dt_s) {
  Arm arm(n);
  const auto peer = maker.make(arm.chain);
  const VectorXd rest = VectorXd::Zero(n);
  const auto steps = static_cast<int>(std::lround(kEnd_s / dt_s));
  int k = steps;
  for (auto _ : state) {
    if (k++ == steps) {
      state.PauseTiming();
      peer->begin(stepper, arm.next().q, rest, dt_s);
      k = 1;
      state.ResumeTiming();
    }
    peer->step();
  }
}

std::string title(const std::string& what, const std::string& who, int n) {
  return std::string(what).append("/").append(who).append("/").append(std::to_string(n));
}

/// Steps of ours are timed over whole seconds of motion, enough of them for a time: how many evaluations a
/// step takes changes on the way, and arms of any length are compared over the same way.
void whole_seconds(benchmark::internal::Benchmark* steps, int n) {
  steps->Iterations(1000 * std::max(1, 100 / n));
}

void add_ours(int n) {
  benchmark::RegisterBenchmark(title("forward", "hamel", n).c_str(), our_forward, n);
  benchmark::RegisterBenchmark(title("inverse", "hamel", n).c_str(), our_inverse, n);
  const std::pair<const char*, Options> tiers[] = {
      {"hamel midpoint", {.tier = Tier::midpoint}},
      {"hamel midpoint feedback", {.tier = Tier::midpoint, .root = Root::feedback}},
      {"hamel midpoint newton", {.tier = Tier::midpoint, .root = Root::newton}},
      {"hamel gauss-4", {.tier = Tier::gauss, .stages = 4}},
      {"hamel gauss-8", {.tier = Tier::gauss, .stages = 8}},
      {"hamel paper", {.tier = Tier::hamel}},
      {"hamel rk4", {.tier = Tier::rk4}},
      {"hamel dopri8", {.tier = Tier::dopri8}},
      {"hamel semi_implicit_euler", {.tier = Tier::semi_implicit_euler}}};
  for (auto [name, options] : tiers) {
    options.dt_s = 1e-3;
    whole_seconds(benchmark::RegisterBenchmark(title("step 1 ms", name, n).c_str(), our_step, n, options), n);
  }
}

void add_planar(int n) {
  for (const scene::Space space : {scene::Space::automatic, scene::Space::se3})
    whole_seconds(
        benchmark::RegisterBenchmark(
            title("planar step 1 ms", space == scene::Space::se3 ? "hamel SE(3)" : "hamel SE(2)", n).c_str(),
            planar_step, n, Options{.dt_s = 1e-3, .space = space}),
        n);
}

/// Where the library itself would end the run.
void left_out(benchmark::State& state, const char* why) { state.SkipWithError(why); }

/// Other libraries; none where ours is built apart, for this processor alone.
const std::vector<peers::Maker>& others() {
#ifdef HAMEL_OURS_ALONE
  static const std::vector<peers::Maker> none;
  return none;
#else
  return peers::makers();
#endif
}

void add_peer(const peers::Maker& maker, int n) {
  benchmark::RegisterBenchmark(title("forward", maker.name, n).c_str(), peer_forward, n, maker);
  if (maker.name != "KDL_Vereshchagin")  // shares KDL's
    benchmark::RegisterBenchmark(title("inverse", maker.name, n).c_str(), peer_inverse, n, maker);
  for (const std::string& stepper : maker.make(Arm(3).chain)->steppers()) {
    const std::string name = title("step 1 ms", maker.name + " " + stepper, n);
    if (stepper == "implicit" && n > 300) {
      benchmark::RegisterBenchmark(name.c_str(), left_out,
                                   "its stack overflows, with room for 16 n^2 numbers too");
    } else {
      benchmark::RegisterBenchmark(name.c_str(), peer_step, n, maker, stepper, 1e-3);
    }
  }
}

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  for (const int n : hamel::kJoints) {
    hamel::add_ours(n);
    for (const auto& maker : hamel::others()) hamel::add_peer(maker, n);
  }
  for (const int n : {3, 4, 7, 30}) hamel::add_planar(n);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
