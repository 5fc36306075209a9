#include "common/scene/options.h"

#include "common/scene/rules.h"

namespace hamel::scene {

Problems problems(const DynamicsOptions& o) {
  Rules r("dynamics.");
  r.positive("dt_s", o.dt_s);
  if (o.dt_s > 0) r.must(o.dt_s >= 1e-9, "dt_s", o.dt_s, ">= 1e-9");
  r.within("alpha", o.alpha, 0, 1);
  r.within("stages", o.stages, 1, 8);
  r.not_negative("tolerance_Nm", o.tolerance_Nm);
  r.positive("tolerance_rel", o.tolerance_rel);
  r.must(o.max_iterations >= 1, "max_iterations", o.max_iterations, ">= 1");
  r.within("max_subdivisions", o.max_subdivisions, 0, 20);
  r.not_negative("stop_stiffness", o.stop_stiffness);
  return r.take();
}

namespace {

void check_forces(const PlannerOptions& o, Rules& r) {
  r.positive("kp", o.kp);
  r.positive("kv", o.kv);
  r.positive_or_inf("vmax_mps", o.vmax_mps);
  r.positive_or_inf("angular_vmax_radps", o.angular_vmax_radps);
  r.positive_or_inf("amax", o.amax);
  r.not_negative("damping", o.damping);
  r.not_negative("eta", o.eta);
  r.positive("rho0_m", o.rho0_m);
  r.not_negative("kobs", o.kobs);
  r.positive("phi_min_rad", o.phi_min_rad);
  r.must(o.c0 > 0 && o.c0 <= 1, "c0", o.c0, "in (0, 1]");
  r.positive("lambda2", o.lambda2);
  r.not_negative("dmin_m", o.dmin_m);
  r.not_negative("barrier_gain", o.barrier_gain);
  r.must(o.kc == 0 || (o.kc >= 1 && std::isfinite(o.kc)), "kc", o.kc, "0 or >= 1 (planar arms: > 1)");
  r.positive("flip_time_s", o.flip_time_s);
  r.not_negative("limit_weight", o.limit_weight);
  if (o.method == Method::gyro && o.barrier_gain > 0)
    r.must(o.dmin_m < o.rho0_m, "dmin_m", o.dmin_m,
           "< rho0_m = " + number(o.rho0_m) + " while the barrier is on");
}

void check_states(const PlannerOptions& o, Rules& r) {
  r.positive("progress_window_s", o.progress_window_s);
  r.positive("goal_tolerance_m", o.goal_tolerance_m);
  r.positive("goal_tolerance_rad", o.goal_tolerance_rad);
  r.positive("goal_tolerance_joint", o.goal_tolerance_joint);
  r.positive("goal_speed", o.goal_speed);
  r.not_negative("goal_hold_s", o.goal_hold_s);
  r.positive("stale_brake_s", o.stale_brake_s);
  r.positive("stale_slow_s", o.stale_slow_s);
  r.must(!(o.stale_slow_s > o.stale_brake_s), "stale_slow_s", o.stale_slow_s,
         "<= stale_brake_s = " + number(o.stale_brake_s));
  r.positive("stale_state_s", o.stale_state_s);
  r.positive("brake_rate", o.brake_rate);
  r.not_negative("assumed_speed_mps", o.assumed_speed_mps);
  r.not_negative("assumed_acceleration_mps2", o.assumed_acceleration_mps2);
  r.not_negative("ramp_s", o.ramp_s);
  r.must(o.escapes >= 0, "escapes", o.escapes, ">= 0");
  r.must(o.escape_rollouts >= 1, "escape_rollouts", o.escape_rollouts, ">= 1");
  r.positive("escape_horizon_s", o.escape_horizon_s);
  r.not_negative("escape_delay_s", o.escape_delay_s);
}

}  // namespace

Problems problems(const PlannerOptions& o) {
  Rules r("planner.");
  r.must(o.period_steps >= 1, "period_steps", o.period_steps, ">= 1");
  check_forces(o, r);
  check_states(o, r);
  return r.take();
}

const char* to_string(Tier v) {
  switch (v) {
    case Tier::hamel:
      return "hamel";
    case Tier::midpoint:
      return "midpoint";
    case Tier::gauss:
      return "gauss";
    case Tier::semi_implicit_euler:
      return "semi_implicit_euler";
    case Tier::rk4:
      return "rk4";
    case Tier::dopri8:
      return "dopri8";
  }
  return "?";
}

const char* to_string(Root v) {
  switch (v) {
    case Root::feedback:
      return "feedback";
    case Root::newton:
      return "newton";
    case Root::adaptive:
      return "adaptive";
  }
  return "?";
}

const char* to_string(Start v) {
  switch (v) {
    case Start::extrapolated:
      return "extrapolated";
    case Start::previous:
      return "previous";
  }
  return "?";
}

const char* to_string(Space v) {
  switch (v) {
    case Space::automatic:
      return "automatic";
    case Space::se3:
      return "se3";
  }
  return "?";
}

const char* to_string(Safe v) {
  switch (v) {
    case Safe::hold:
      return "hold";
    case Safe::brake:
      return "brake";
  }
  return "?";
}

const char* to_string(Method v) {
  switch (v) {
    case Method::attract:
      return "attract";
    case Method::khatib:
      return "khatib";
    case Method::gyro_paper:
      return "gyro_paper";
    case Method::gyro:
      return "gyro";
  }
  return "?";
}

const char* to_string(GainForm v) {
  switch (v) {
    case GainForm::F1:
      return "F1";
    case GainForm::F2:
      return "F2";
    case GainForm::F3:
      return "F3";
    case GainForm::S:
      return "S";
  }
  return "?";
}

const char* to_string(Mapping v) {
  switch (v) {
    case Mapping::paper:
      return "paper";
    case Mapping::force:
      return "force";
    case Mapping::symmetric:
      return "symmetric";
  }
  return "?";
}

const char* to_string(PairPolicy v) {
  switch (v) {
    case PairPolicy::nearest:
      return "nearest";
    case PairPolicy::all:
      return "all";
  }
  return "?";
}

const char* to_string(Unreachable v) {
  switch (v) {
    case Unreachable::reject:
      return "reject";
    case Unreachable::approach:
      return "approach";
  }
  return "?";
}

Problems problems(const Accuracy& o) {
  Rules r("accuracy.");
  r.positive_or_inf("joint_error_rad", o.joint_error_rad);
  r.positive_or_inf("energy_error_rel", o.energy_error_rel);
  r.not_negative("horizon_s", o.horizon_s);
  r.positive("obstacle_error_m", o.obstacle_error_m);
  return r.take();
}

const char* to_string(Fidelity v) {
  switch (v) {
    case Fidelity::full:
      return "full";
    case Fidelity::exact:
      return "exact";
    case Fidelity::fastest:
      return "fastest";
  }
  return "?";
}

const char* to_string(Choice v) {
  switch (v) {
    case Choice::automatic:
      return "automatic";
    case Choice::off:
      return "off";
    case Choice::on:
      return "on";
  }
  return "?";
}

const char* to_string(Pace v) {
  switch (v) {
    case Pace::lockstep:
      return "lockstep";
    case Pace::realtime:
      return "realtime";
  }
  return "?";
}

const char* to_string(StopRule v) {
  switch (v) {
    case StopRule::at_duration:
      return "at_duration";
    case StopRule::when_reached:
      return "when_reached";
  }
  return "?";
}

}  // namespace hamel::scene
