// What the recursions and a step cost, against the number of joints.  Times are for reading and for ratios in
// one run; no test asserts them.
//   cmake --preset core -B build/bench -DHAMEL_BENCH=ON && ninja -C build/bench dynamics_bench
//   build/bench/tests/bench/dynamics_bench
#include <benchmark/benchmark.h>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"

namespace hamel {
namespace {

using Eigen::VectorXd;

/// A spatial arm of n revolute joints, falling.
struct Arm {
  explicit Arm(int joints)
      : n(joints),
        chain(test::random_chain(rng, n, {.prismatic = 0, .armature = 0, .mass_spread = 0.3})),
        q(rng.vector(n, 3)),
        qd(rng.vector(n, 1)),
        tau(rng.vector(n, 1)) {}
  int n;
  test::Random rng{1};
  model::Chain chain;
  VectorXd q, qd, tau;
};

void forward_dynamics(benchmark::State& state) {
  const Arm arm(static_cast<int>(state.range(0)));
  rbd::Workspace ws(arm.chain);
  VectorXd qdd(arm.n);
  for (auto _ : state) {
    rbd::forward_dynamics(arm.chain, arm.q, arm.qd, arm.tau, ws, qdd);
    benchmark::DoNotOptimize(qdd.data());
  }
}
BENCHMARK(forward_dynamics)->Arg(3)->Arg(7)->Arg(30)->Arg(100)->Arg(1000);

void inverse_dynamics(benchmark::State& state) {
  const Arm arm(static_cast<int>(state.range(0)));
  rbd::Workspace ws(arm.chain);
  VectorXd tau(arm.n);
  for (auto _ : state) {
    rbd::inverse_dynamics(arm.chain, arm.q, arm.qd, arm.tau, ws, tau);
    benchmark::DoNotOptimize(tau.data());
  }
}
BENCHMARK(inverse_dynamics)->Arg(3)->Arg(7)->Arg(30)->Arg(100)->Arg(1000);

/// Steps of an arm that swings; begins again every simulated second.
void step(benchmark::State& state, dynamics::Options options, int n) {
  const model::Chain chain = test::checked(test::planar(n, 1.0, n > 30 ? 3.0 / n : 0.1, 0.01));
  dynamics::Integrator integrator(chain, options);
  const dynamics::State begin = integrator.start(VectorXd::Zero(n), VectorXd::Zero(n));
  const VectorXd tau = VectorXd::Zero(n);
  dynamics::State s = begin;
  double evaluations = 0, steps = 0;
  for (auto _ : state) {
    if (static_cast<double>(s.step) * options.dt_s >= 1) s = begin;
    const dynamics::StepReport report = integrator.step(s, tau);
    if (!report.usable()) return state.SkipWithError("step failed");
    evaluations += report.evaluations;
    ++steps;
  }
  state.counters["evaluations"] = evaluations / steps;
}

using scene::Root;
using scene::Space;
using scene::Tier;
#define STEP(name, ...)                                                            \
  void name(benchmark::State& state) {                                             \
    step(state, dynamics::Options{__VA_ARGS__}, static_cast<int>(state.range(0))); \
  }                                                                                \
  BENCHMARK(name)->Arg(3)->Arg(4)->Arg(7)->Arg(30)->Arg(100)->Arg(1000)
STEP(midpoint_1ms, .tier = Tier::midpoint, .dt_s = 1e-3);
STEP(midpoint_10ms, .tier = Tier::midpoint, .dt_s = 1e-2);
STEP(midpoint_1ms_se3, .tier = Tier::midpoint, .dt_s = 1e-3, .space = Space::se3);
STEP(midpoint_10ms_se3, .tier = Tier::midpoint, .dt_s = 1e-2, .space = Space::se3);
STEP(midpoint_newton_10ms, .tier = Tier::midpoint, .dt_s = 1e-2, .root = Root::newton);
STEP(gauss4_10ms, .tier = Tier::gauss, .dt_s = 1e-2, .stages = 4);
STEP(rk4_1ms, .tier = Tier::rk4, .dt_s = 1e-3);
STEP(semi_implicit_euler_1ms, .tier = Tier::semi_implicit_euler, .dt_s = 1e-3);

}  // namespace
}  // namespace hamel

BENCHMARK_MAIN();
