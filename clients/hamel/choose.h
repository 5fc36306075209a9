#pragma once
/// Tier and step for the accuracy that a scene asks for, found by running it.

#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/trade_sweep.h"
#include "common/scene/scene.h"
#include "services/planner/core/planner.h"

namespace hamel::client {

/// One way to run a scene, measured against its converged motion.
struct Setting {
  scene::DynamicsOptions dynamics;
  int period_steps = 1;
  bool finished = false;     ///< false: a step was refused, or had to be divided
  bool same_end = true;      ///< steered: ends in the reference's state, without contact where it has none
  double joint_error = 0;    ///< largest |q - q_ref| at 20 instants of the horizon [rad or m]
  double energy_error = 0;   ///< over the energy scale
  double seconds_per_s = 0;  ///< CPU time of a simulated second, ticks alone
  double work_per_s = 0;     ///< what the choice goes by: counted, not timed [us]
};

/// The converged motion of a scene: free motions by gauss-8, steered ones by ever shorter steps and cycles.
struct Converged {
  std::vector<Eigen::VectorXd> q;  ///< at the instants
  double horizon_s = 0, uncertainty = 0, dt_s = 0;
  planner::State end = planner::State::idle;
  std::uint64_t contacts = 0;
};

struct Choosing {
  Converged reference;
  std::vector<Setting> tried;
  std::optional<Setting> chosen;  ///< none: nothing tried meets the accuracy
};

/// The scene by another tier, step and planner period.
scene::Scene with(const scene::Scene& scene, const scene::DynamicsOptions& dynamics, int period_steps);
Converged converge(const scene::Scene& scene, const trade::Watch& watch);
Setting measure(const scene::Scene& scene, const Converged& reference, const trade::Watch& watch);

/// Runs the scene by many tiers, steps and planner periods.  The choice counts evaluations and planner
/// cycles, each with the time it usually takes, so that it is the same on every machine and in every process;
/// wall times stand beside it.
Choosing choose(const scene::Scene& scene, const trade::Watch& watch);
/// What no joint is off by at any time of the horizon, by the rule that `hamel trade` recommends by
/// (trade_choice.h) [rad or m].
double error_bound(const Setting& s, const Converged& reference) noexcept;
/// True when a setting's bound keeps to what was asked.
bool meets(const scene::Accuracy& asked, const Setting& s, const Converged& reference) noexcept;
/// The scene with the chosen setting, and its entry "step" in Scene::reductions; without a choice the entry
/// says so.
void apply(const Choosing& c, scene::Scene& scene);
/// The same as overrides: "dynamics.tier=gauss" and so on.
std::vector<std::string> overrides(const Setting& s);
/// The CPU time of the calling thread, so that what else the machine does is not counted, and no early end.
trade::Watch steady_watch();

}  // namespace hamel::client
