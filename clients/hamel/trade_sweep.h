#pragma once
/// Accuracy against cost of every tier on one's own arm: pure but for an injected clock.
///
/// The problem is the arm's free motion from (q0, qd0).  The reference is gauss with 8 stages, its step
/// halved until two runs agree; where the motion is chaotic they agree only up to some time, and errors count
/// up to it.

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "services/dynamics/core/integrator.h"

namespace hamel::trade {

inline constexpr int kSamples = 20;      ///< instants, evenly over the horizon, at which joints are compared
inline constexpr double kAgreed = 1e-9;  ///< two references that differ by less agree [rad or m]

struct Motion {
  const model::Chain& chain;
  Eigen::VectorXd q0, qd0;
  double horizon_s = 0;
  double tick_s = std::numeric_limits<double>::infinity();  ///< no candidate's dt_s is longer
  dynamics::Options base;  ///< what the candidates start from; its dt_s is the middle of the steps tried
};

/// The clock, whether to end early, and who is told what is being done, if any; all may be called often.
struct Watch {
  std::function<double()> now_s;
  std::function<bool()> stop;
  std::function<void(const std::string&)> tell = {};
  void say(const std::string& what) const {
    if (tell) tell(what);
  }
};

struct Reference {
  std::vector<Eigen::VectorXd> q;  ///< at the kSamples instants
  double dt_s = 0;                 ///< the finer step of the two that agree best
  double uncertainty =
      std::numeric_limits<double>::infinity();  ///< largest difference of the two where valid
  double valid_s = 0;  ///< they agree to kAgreed, or as far as any two do, up to here
};

/// What one run cost and how far off it ended.
struct Measured {
  dynamics::Options options;
  bool finished = false;  ///< false: a step was refused at refused_s
  double refused_s = 0;
  /// Largest |q - q_ref| at an instant where the reference holds [rad or m]; NaN: nothing was compared.
  double joint_error = std::numeric_limits<double>::quiet_NaN();
  double energy_error = 0;    ///< largest |E - E(0) - work| over the energy scale
  double momentum_error = 0;  ///< largest |p_1 - p_1(0)| over the largest momentum; NaN: not conserved
  double seconds_per_s = 0;   ///< wall time of a simulated second
  double evaluations_per_s = 0;
  double iterations_mean = 0;
  int iterations_max = 0;
  std::uint64_t substepped = 0;  ///< steps that had to be divided
  bool on_front = false;         ///< nothing measured is both cheaper and more accurate
};

/// True when turning (or sliding) joint 1 changes nothing: no gravity along it, no damping, no stops.
bool first_momentum_stays(const model::Chain& chain, const dynamics::Options& options);
/// Everything tried: tiers x root finders x steps x tolerances; fewer when quick.
std::vector<dynamics::Options> candidates(const Motion& motion, bool quick);
/// The step nearest to dt_s that divides the time between two instants.
double fitting_step(double dt_s, double horizon_s);
/// The name for a table, e.g. "gauss-8" or "midpoint newton".
std::string label(const dynamics::Options& options);

Reference converge(const Motion& motion, const Watch& watch);
Measured measure(const Motion& motion, const dynamics::Options& options, const Reference& reference,
                 const Watch& watch);

}  // namespace hamel::trade
