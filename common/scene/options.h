#pragma once
/// What a user may set for dynamics, planner and perception: names, defaults, units and rules in one place.
/// The text format (deploy/README.md) uses the same names.

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::scene {

inline constexpr double kInf = std::numeric_limits<double>::infinity();

enum class Tier : std::uint8_t { hamel, midpoint, gauss, semi_implicit_euler, rk4, dopri8 };
enum class Root : std::uint8_t { feedback, newton, adaptive };
enum class Start : std::uint8_t { extrapolated, previous };
enum class Space : std::uint8_t { automatic, se3 };
enum class Safe : std::uint8_t { hold, brake };  ///< keep the place, or only come to rest; gravity is held

/// How the arm is integrated.
struct DynamicsOptions {
  Tier tier = Tier::midpoint;
  double dt_s = 1e-3;          ///< time step, > 0
  double alpha = 0.5;          ///< tier hamel: where in the step (9) takes the velocity, in [0, 1]
  int stages = 4;              ///< tier gauss: 1..8, order 2 * stages
  Root root = Root::adaptive;  ///< Eq. (16); Newton with the exact recursive Jacobian; what costs less
  Start start =
      Start::extrapolated;       ///< first guess of the increment; `previous` is the paper's q^{k+1} = q^k
  double tolerance_Nm = 0;       ///< stop when |residual|_inf is below; 0: scaled with momentum, to rounding
  double tolerance_rel = 1e-10;  ///< dopri8: relative local error
  int max_iterations = 32;       ///< root-finding budget of one step, >= 1
  int max_subdivisions = 6;      ///< a step that does not converge is halved up to this often, 0..20
  double stop_stiffness =
      0;  ///< smooth hard stops at joint limits: k e^2/(e + 1e-3) at e beyond [N m/rad], 0: none
  Safe on_silence = Safe::hold;    ///< what the arm does while its planner is silent
  Space space = Space::automatic;  ///< a planar arm is computed on SE(2), unless se3 is asked for
};

enum class Method : std::uint8_t { attract, khatib, gyro_paper, gyro };
enum class GainForm : std::uint8_t { F1, F2, F3, S };  ///< readings of Eq. (20); S: scaled with speed
enum class Mapping : std::uint8_t { paper, force, symmetric };  ///< Eq. (21) verbatim; J^T f; powerless
enum class PairPolicy : std::uint8_t { nearest, all };
enum class Unreachable : std::uint8_t { reject, approach };

/// How the arm is steered.  Defaults are for a planar arm of unit links; scenes say their own.
struct PlannerOptions {
  Method method = Method::gyro;
  int period_steps = 1;              ///< a command every so many dynamics steps, >= 1
  double kp = 10;                    ///< attraction, Eq. (17) [1/s^2], > 0
  double kv = 6.3;                   ///< attraction, Eq. (17) [1/s], > 0
  double vmax_mps = kInf;            ///< target speed the attraction saturates at, > 0
  double angular_vmax_radps = kInf;  ///< pose goals: turning speed the attraction saturates at, > 0
  double amax = kInf;                ///< acceleration limit of the command [rad/s^2 or m/s^2], > 0
  double damping = 0.5;              ///< bj: tau_d = -bj M qd [1/s], >= 0
  double eta = 0.02;                 ///< Khatib's repulsion, Eq. (18), >= 0
  double rho0_m = 0.5;               ///< influence distance to the surface, > 0
  double kobs = 1;                   ///< gyroscopic gain, Eq. (20), >= 0
  GainForm gain_form = GainForm::S;
  Mapping mapping = Mapping::symmetric;
  PairPolicy pairs = PairPolicy::all;
  bool relative_velocity = true;   ///< gyro force from the velocity relative to the obstacle
  double phi_min_rad = 1.0 / 3.0;  ///< F2: exp(1/max(phi, phi_min)), > 0
  double c0 = 0.2;                 ///< S: closing gate, in (0, 1]
  double lambda2 = 1e-3;           ///< damping of operational-space inertia, > 0
  bool lambda2_relative = true;    ///< true: times trace(J M^-1 J^T); false: absolute [1/kg]
  double dmin_m = 0.01;            ///< clearance the barrier keeps, >= 0; barrier off where barrier_gain is 0
  double barrier_gain = 30;        ///< gyro: of the barrier, h.. + 2 g h. + g^2 h >= 0 [1/s], 0: off
  double kc = 2;                   ///< gyro: held-direction circulation, 0 or > 1 (1 allowed on spatial arms)
  double flip_time_s = 3;          ///< circulation flips when the error has not fallen 10 % in it, > 0
  double limit_weight = 0;         ///< of joints near their limits in the attraction, 0: plain
  double progress_window_s = 3;    ///< STUCK when no 10 % progress in it, > 0
  double goal_tolerance_m = 0.01;  ///< REACHED within, > 0
  double goal_tolerance_rad = 0.02;    ///< pose goals: REACHED within, > 0
  double goal_tolerance_joint = 0.01;  ///< joint goals: each joint within, > 0
  double goal_speed = 0.05;            ///< REACHED below [m/s], > 0
  double goal_hold_s = 0.1;            ///< REACHED after so long, >= 0
  double stale_brake_s = 0.3;          ///< obstacles older than this: stop and UNSAFE, > 0
  double stale_slow_s = 0.1;           ///< obstacles older than this: slow down, > 0
  double stale_state_s = 0.05;         ///< arm state older than this: brake and UNSAFE, > 0
  double brake_rate = 60;              ///< bmax: braking is qdd = -(bmax + 15/speed) qd [1/s], > 0
  double assumed_speed_mps =
      1;  ///< inflation per second of age where an obstacle's velocity is unknown, >= 0
  double assumed_acceleration_mps2 = 1;  ///< a of the inflation a/2 age^2 of every obstacle, >= 0
  int escapes = 8;                       ///< gyro: ways out looked for by rollouts at one goal, 0: none
  int escape_rollouts = 16;              ///< waypoints tried for one way out, >= 1
  double escape_horizon_s = 12;          ///< how far ahead a rollout looks, > 0
  double escape_delay_s = 0.2;           ///< the answer enters so long after the question, >= 0
  /// A target that no configuration meets, or that an obstacle stands over: STUCK at once and no motion, or
  /// as near as can be and then STUCK.
  Unreachable unreachable = Unreachable::reject;
  double ramp_s = 0.2;  ///< after a restart without memory the command ramps in over it, >= 0
};
/// How far an obstacle may have got in `age_s` beyond where its velocity takes it [m].
inline double accelerated_m(const PlannerOptions& o, double age_s) noexcept {
  return 0.5 * o.assumed_acceleration_mps2 * age_s * age_s;
}

/// How much of what a scene writes is computed.
enum class Fidelity : std::uint8_t {
  full,    ///< all of it, as written
  exact,   ///< what changes no result is left out
  fastest  ///< what changes results by less than the scene's accuracy is left out too
};
enum class Choice : std::uint8_t { automatic, off, on };  ///< as the fidelity says; never; whatever it says

/// What a scene allows to be reduced (reduce.h).
struct ReduceOptions {
  Fidelity fidelity = Fidelity::exact;
  Choice locked = Choice::automatic;     ///< exact: locked joints become part of the link that carries them
  Choice plane = Choice::automatic;      ///< exact: SE(2) where the arm is planar
  Choice gravity = Choice::automatic;    ///< exact: none where it works on no joint
  Choice obstacles = Choice::automatic;  ///< exact: those that can never matter are culled, set by set
  Choice links = Choice::automatic;      ///< exact but for their reports: links far from all are not measured
  Choice self = Choice::automatic;       ///< exact: pairs of links that cannot have met yet are passed over
  Choice shapes = Choice::automatic;     ///< bounded: links as fewer and simpler solids, outward
  Choice merge = Choice::automatic;      ///< bounded: obstacles put together, outward
  Choice requery = Choice::automatic;  ///< bounded, reports alone: links that went no way are not asked again
  Choice rate = Choice::automatic;     ///< bounded: perception no faster than the obstacles need
  Choice cycle = Choice::automatic;    ///< bounded: planner cycles no faster than anything closes in
  Choice step = Choice::automatic;     ///< bounded: tier and step chosen for the accuracy
};

/// What `fastest` may cost, and what it is judged by.
struct Accuracy {
  double joint_error_rad = 1e-3;   ///< of any joint at any time of the horizon [rad or m], > 0
  double energy_error_rel = kInf;  ///< of the energy scale, > 0
  double horizon_s = 0;            ///< 0: the run; >= 0
  double obstacle_error_m = 1e-3;  ///< how far a surface of an obstacle or a link may be off, > 0
};

enum class Pace : std::uint8_t { lockstep, realtime };
enum class StopRule : std::uint8_t { at_duration, when_reached };

/// Every violated rule, as "dynamics.dt_s" / "= -1, must be > 0".  Empty when valid.
Problems problems(const DynamicsOptions& o);
Problems problems(const PlannerOptions& o);
Problems problems(const Accuracy& o);

/// The name the user writes, e.g. to_string(Tier::gauss) == "gauss".
const char* to_string(Tier v);
const char* to_string(Root v);
const char* to_string(Start v);
const char* to_string(Space v);
const char* to_string(Safe v);
const char* to_string(Method v);
const char* to_string(GainForm v);
const char* to_string(Mapping v);
const char* to_string(PairPolicy v);
const char* to_string(Unreachable v);
const char* to_string(Pace v);
const char* to_string(Fidelity v);
const char* to_string(Choice v);
const char* to_string(StopRule v);

}  // namespace hamel::scene
