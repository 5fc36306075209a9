#include "services/dynamics/convert.h"

namespace hamel::dynamics {

namespace {

wire::SolverStop to_wire(Stop s) {
  switch (s) {
    case Stop::converged:
      return wire::SolverStop::converged;
    case Stop::stagnated:
      return wire::SolverStop::stagnated;
    case Stop::budget_spent:
      return wire::SolverStop::budget_spent;
    case Stop::diverged:
      return wire::SolverStop::diverged;
    case Stop::explicit_step:
      return wire::SolverStop::explicit_step;
  }
  return wire::SolverStop::diverged;
}

}  // namespace

void to_wire(const Arm& arm, wire::ArmState& out) {
  const State& s = arm.state();
  out.step = s.step;
  out.t_s = arm.t_s();
  out.dt_s = arm.options().dt_s;
  out.position = s.q;
  out.velocity = s.qd;
  out.momentum = s.p;
  out.torque_applied = arm.torque_applied();
  out.torque_saturated = arm.torque_saturated();
  out.energy_J = arm.books().energy_J;
  out.work_J = arm.books().work_J;
  const StepReport& r = arm.report();
  out.solver.stop = to_wire(r.stop);
  out.solver.iterations = static_cast<std::uint32_t>(r.iterations);
  out.solver.evaluations = static_cast<std::uint32_t>(r.evaluations);
  out.solver.substeps = static_cast<std::uint32_t>(r.substeps);
  out.solver.residual_Nm = r.residual_Nm;
}

void to_wire(const Arm& arm, wire::RunSummary& out) {
  const Books& b = arm.books();
  out.steps = b.steps;
  out.energy_drift_rel = arm.energy_drift_rel();
  out.iterations_mean = b.steps > 0 ? b.iterations_sum / static_cast<double>(b.steps) : 0;
  out.iterations_max = b.iterations_max;
  out.residual_max_Nm = b.residual_max_Nm;
  out.substepped = b.substepped;
}

}  // namespace hamel::dynamics
