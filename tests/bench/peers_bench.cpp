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

/// A spatial arm that hangs and swings: 3 m long, or links of 0.1 m where that is longer.
model::ChainSpec arm_spec(int n) {
  const double length_m = std::max(3.0 / n, 0.1);
  model::ChainSpec spec;
  spec.name = "arm";
  spec.gravity_W_mps2 = {9.81, 0, 0};
  for (int i = 0; i < n; ++i) {
    model::Joint joint;
    joint.X_PJ.p = {i > 0 ? length_m : 0.0, 0, 0};
    joint.axis = i % 3 == 0   ? Eigen::Vector3d::UnitZ()
                 : i % 3 == 1 ? Eigen::Vector3d::UnitY()
                              : Eigen::Vector3d(0.6, 0, 0.8);
    model::Link link;
    link.inertia.mass_kg = 3 * length_m;
    link.inertia.com_m = {0.5 * length_m, 0.01, 0};
    const double across = link.inertia.mass_kg * (0.05 * 0.05 + length_m * length_m / 12);
    link.inertia.about_com_kgm2 = Eigen::Vector3d(link.inertia.mass_kg * 0.003, across, across).asDiagonal();
    spec.joints.push_back(joint);
    spec.links.push_back(link);
  }
  return spec;
}

struct Given {
  VectorXd q, qd, tau;
};

struct Arm {
  explicit Arm(int joints) : n(joints), chain(test::checked(arm_spec(joints))), states{} {
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

void our_step(benchmark::State& state, int n, Options options) {
  Arm arm(n);
  dynamics::Integrator integrator(arm.chain, options);
  const dynamics::State begin = integrator.start(arm.next().q, VectorXd::Zero(n));
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

/// What a library does with matrices ends where one call would take seconds.
bool bearable(const std::string& name, const std::string& what, int n) {
  if (name == "KDL" && what != "inverse") return n <= 100;
  if (name == "MuJoCo" && (what == "RK4" || what == "implicit")) return n <= 300;
  return true;
}

std::string title(const std::string& what, const std::string& who, int n) {
  return std::string(what).append("/").append(who).append("/").append(std::to_string(n));
}

void add_ours(int n) {
  benchmark::RegisterBenchmark(title("forward", "hamel", n).c_str(), our_forward, n);
  benchmark::RegisterBenchmark(title("inverse", "hamel", n).c_str(), our_inverse, n);
  const std::pair<const char*, Options> tiers[] = {
      {"hamel midpoint", {.tier = Tier::midpoint}},
      {"hamel midpoint newton", {.tier = Tier::midpoint, .root = Root::newton}},
      {"hamel gauss-4", {.tier = Tier::gauss, .stages = 4}},
      {"hamel rk4", {.tier = Tier::rk4}},
      {"hamel semi_implicit_euler", {.tier = Tier::semi_implicit_euler}}};
  for (auto [name, options] : tiers) {
    options.dt_s = 1e-3;
    benchmark::RegisterBenchmark(title("step 1 ms", name, n).c_str(), our_step, n, options);
  }
}

void add_peer(const peers::Maker& maker, int n) {
  if (bearable(maker.name, "forward", n))
    benchmark::RegisterBenchmark(title("forward", maker.name, n).c_str(), peer_forward, n, maker);
  if (maker.name != "KDL_Vereshchagin")  // shares KDL's
    benchmark::RegisterBenchmark(title("inverse", maker.name, n).c_str(), peer_inverse, n, maker);
  const auto names = maker.make(Arm(3).chain)->steppers();
  for (const std::string& stepper : names)
    if (bearable(maker.name, stepper, n))
      benchmark::RegisterBenchmark(title("step 1 ms", maker.name + " " + stepper, n).c_str(), peer_step, n,
                                   maker, stepper, 1e-3);
}

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  for (const int n : hamel::kJoints) {
    hamel::add_ours(n);
    for (const auto& maker : hamel::peers::makers()) hamel::add_peer(maker, n);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
