"""The laws of the dynamics and of the planner, and for each a wrong sign that its test must see.

file, old, new: one place of the source; test, filter: who must fail.
"""

from typing import NamedTuple


class Mutant(NamedTuple):
    name: str
    law: str
    file: str
    old: str
    new: str
    test: str
    filter: str


CORE = "services/dynamics/core/"
PLAN = "services/planner/core/"
MUTANTS = [
    Mutant("dexp_turns_back", "dexp is the slope of exp", "common/lie/so3.h", "Identity() + cosc(x) * W + sinc3(x)",
           "Identity() - cosc(x) * W + sinc3(x)", "lie_accuracy_test", "*Rotations*"),
    Mutant("coupling_of_rigid_dexp", "dexp of SE(3) to 8 eps", "common/lie/se3.h", "- 3 * WPW)", "+ 3 * WPW)",
           "lie_accuracy_test", "*RigidMotions*"),
    Mutant("log_of_the_plane", "log undoes exp on SE(2)", "common/lie/se2.h", "* X.p - 0.5 * t * quarter_turn(X.p)",
           "* X.p + 0.5 * t * quarter_turn(X.p)", "lie_accuracy_test", "*PlanarMotions*"),
    Mutant("coadjoint", "inverse dynamics is Lagrange's", "common/rbd/spatial.h", "return {cross(F.a, V.a) + cross(F.l, V.l), cross(F.l, V.a)};",
           "return {cross(F.a, V.a) - cross(F.l, V.l), cross(F.l, V.a)};", "rbd_test", "*Lagranges*"),
    Mutant("weight_pulls_up", "gravity torque is the slope of U", "common/rbd/kinematics.cpp", "tau_g[i] = -chain.A_B(i).dot(W);",
           "tau_g[i] = chain.A_B(i).dot(W);", "rbd_test", "*GravityTorque*"),
    Mutant("bias_without_circling", "Jdot qd is the slope of velocity", "common/rbd/kinematics.cpp", "+ w.cross(v_point))",
           "- w.cross(v_point))", "rbd_test", "*BiasAcceleration*"),
    Mutant("wrench_backwards", "power balance", "common/rbd/kinematics.cpp", "tau[i] += chain.A_B(i).dot(F);",
           "tau[i] -= chain.A_B(i).dot(F);", "rbd_test", "*PowerOfAll*"),
    Mutant("screw_frames", "screws build the same arm", "common/model/screws.cpp", "(X_B0L.p - X_B0B.p)", "(X_B0B.p - X_B0L.p)",
           "screws_test", "*SameArm*"),
    Mutant("legendre_at_the_end", "the midpoint step is symplectic", CORE + "midpoint.cpp", "p_next[i] = p[i] + 2 * (turn + push);",
           "p_next[i] = p[i] + 2 * (push - turn);", "variational_test", "*Symplectic*"),
    Mutant("force_at_the_end", "forces cost no order", CORE + "midpoint.cpp", "p_next[i] = p[i] + 2 * (turn + push);",
           "p_next[i] = p[i] + 2 * turn + push;",
           "orders_test", "*Richardson*"),
    Mutant("damping_by_old_rate", "dense and discrete forces do the work", CORE + "rivals.cpp", "power += (tau[i] - chain_[i].damping",
           "power += (tau[i] + chain_[i].damping", "variational_test", "*WorkIs*"),
    Mutant("gauss_matrix", "every gauss is symplectic", CORE + "gauss_method.cpp", "a(i, j) = static_cast<double>(integral);",
           "a(i, j) = static_cast<double>(integral) * (i == 0 ? 0.999 : 1);", "variational_test", "*StepIsSymplectic*"),
    Mutant("gauss_turn", "gauss of one stage is midpoint", CORE + "gauss_stages.h", "coadjoint_along(k, X, w.V[i], H) + weight_along",
           "coadjoint_along(k, X, w.V[i], H) - weight_along", "variational_test", "*GaussOfOneStage*"),
    Mutant("stiff_damping", "damping of any strength in one step", CORE + "gauss_stiff.cpp", "= mode.lambda * c +", "= -mode.lambda * c +",
           "extremes_test", "Damping*"),
    Mutant("runge_kutta_weights", "order 4", CORE + "rivals.cpp", "1. / 3, 1. / 3, 1. / 6}", "1. / 3, 1. / 6, 1. / 3}",
           "orders_test", "*Richardson*"),
    Mutant("prince_dormand_digit", "conditions of order 8", CORE + "dopri8.cpp", "0.0542937341165687622380535766363",
           "0.0542937341175687622380535766363", "dopri8_test", "*OrderEight*"),
    Mutant("papers_past", "Eq. (13) is the paper's", CORE + "paper.cpp", "(sign * share * h_) * coadjoint", "(-sign * share * h_) * coadjoint",
           "loads_test", "*DiscreteInverse*"),
    Mutant("forgotten_history", "2N steps = N, save, load, N", CORE + "marcher.cpp",
           "std::copy_n(s.history.begin(), own, now_->history.begin());", "", "integrator_robustness_test", "*ResumesBitForBit*"),
    Mutant("hasty_pace", "one idle update makes no slow pace", CORE + "increment_root.h", "std::sqrt(relative / before_)", "relative / last_",
           "increment_root_test", "*OneIdle*"),
    Mutant("trusting_end", "the last update is not looked at only where it leaves rounding", CORE + "increment_root.h",
           "last_ * std::max(rate_, least_) <= rounding_", "last_ * least_ <= rounding_", "increment_root_test", "*AlsoWhere*"),
    Mutant("ledger_forgets", "the report's ledger sums", CORE + "marcher.cpp", "ledger_.made_up += made_up;", "ledger_.made_up = made_up;",
           "loads_test", "*WorkOfAll*"),
    Mutant("infinite_work", "no number that is none", CORE + "marcher.cpp", "if (!std::isfinite(in_play) || !std::isfinite(made_up)) return false;",
           "", "integrator_robustness_test", "Torque*"),
    Mutant("any_turn", "a root that turns a joint absurdly far is no step", CORE + "marcher.cpp", "std::abs(d - h * qd[i]) > bound)",
           "std::abs(d - h * qd[i]) > 10 * bound)", "guards_test", "*SpuriousRoot*by_its_turn"),
    Mutant("any_energy", "a root that makes up energy is no step", CORE + "marcher.cpp", "kEnergyBound = 0.1;", "kEnergyBound = 0.24;",
           "guards_test", "*SpuriousRoot*by_its_energy"),
    Mutant("any_drift", "steps that add to a drift are refused", CORE + "marcher.cpp", "kDrift = 0.25,", "kDrift = 0.5,",
           "guards_test", "Ledger.*"),
    Mutant("planar_axis", "planar is spatial", "common/rbd/planar_chain.cpp", "axis.z() < 0 ? -1 : 1", "axis.z() < 0 ? 1 : 1", "planar_test", "*Moves*"),
    Mutant("effort_ignored", "torque is cut at the limit", CORE + "integrator.cpp", "std::clamp(*tau, -limits.effort, limits.effort)", "std::clamp(*tau, -2 * limits.effort, 2 * limits.effort)",
           "integrator_robustness_test", "Limits*"),
    Mutant("stiffer_stops", "stops are no stiffer than said", CORE + "tier.h", "e > 0 ? stiffness * (1 - r * r)", "e > 0 ? stiffness * (1 + r * r)",
           "integrator_robustness_test", "Stops*"),
    Mutant("potential_upside_down", "work is the change of energy", CORE + "node.cpp", "chain.potential_offset - dot(", "chain.potential_offset + dot(",
           "variational_test", "*WorkIs*"),
    Mutant("gyro_that_works", "the mapping is powerless", PLAN + "mapping.cpp", "G(j, i) -= g;", "G(j, i) += g;",
           "planner_force_law_test", "Mapping.*"),
    Mutant("mapping_without_trace", "symmetric is the skew part of the paper's", PLAN + "mapping.cpp", "0.5 * (Lam.trace() * w - Lam * w)",
           "0.5 * (Lam.trace() * w + Lam * w)", "planner_force_law_test", "*SkewPart*"),
    Mutant("gate_of_who_leaves", "only who closes is turned", PLAN + "force_law.cpp", "closing <= 0", "closing >= 0",
           "planner_force_law_test", "*"),
    Mutant("gain_without_speed", "stops at the closed form", PLAN + "force_law.cpp", "o.kobs * n.dot(v) / near * open", "o.kobs / near * open",
           "planner_force_law_test", "FreeParticle.*"),
    Mutant("flat_distance", "second derivative of the distance", PLAN + "barrier.cpp", "(w.squaredNorm() - along * along) / D",
           "(w.squaredNorm() + along * along) / D", "planner_barrier_test", "*SecondDerivative*"),
    Mutant("torque_without_gravity", "limits hold for the sum with gravity", PLAN + "barrier.cpp", "arm.coriolis[j] + arm.gravity[j]",
           "arm.coriolis[j] - arm.gravity[j]", "planner_obstacles_test", "TorqueLimits.*"),
    Mutant("no_ramp", "a ramp begins with a hold", PLAN + "steering.cpp", "tau_att *= ramped;", "", "planner_states_test", "*Ramp*"),
    Mutant("tank_without_braking", "the pull's braking pays for circulation", PLAN + "steering.cpp", "+ pull_share * std::max(",
           "+ 0 * std::max(", "planner_example_5_2_test", "*StartsAgain*"),
    Mutant("goal_beside_a_wall", "a goal with room beside an obstacle is tried", PLAN + "pursuit.cpp",
           "attraction.target(), turns, margin_m - slack", "attraction.target(), turns, margin_m - slack + 1", "planner_states_test", "*HasRoom*"),
    Mutant("goal_in_a_wall", "a goal inside what stands is refused at once", PLAN + "pursuit.cpp",
           "attraction.target(), turns, margin_m - slack", "attraction.target(), turns, margin_m - slack - 1", "planner_states_test", "*InsideWhatStands*"),
    Mutant("target_behind", "a moving target is followed", "common/lie/se3.h", "X.p += t_s *", "X.p -= t_s *",
           "planner_goals_test", "*Followed*"),
    Mutant("merged_too_far", "obstacles are put together within the bound", "common/scene/outward.cpp", "room.push_back(most_m_ *",
           "room.push_back(2 * most_m_ *", "scene_outward_test", "MergedObstacles.*"),
    Mutant("cycles_never_hurry", "cycles as often as written while a point is fast", "common/scene/cadence.cpp", "<= hurry_mps_);",
           "<= 2 * hurry_mps_);", "scene_outward_test", "Cycle.*"),
    Mutant("locked_on_is_base", "what is locked onto the base keeps its nearest", "common/scene/reach.cpp", "nearest_m_[n] = -inf;",
           "nearest_m_[n] = nearest_m_[n + 1] = -inf;", "scene_reduce_test", "*Locked*"),
    Mutant("rests_too_long", "a link that is not asked went no farther than the bound", PLAN + "pairs.cpp",
           "std::min(savings_.requery_m, a.spare_m)", "a.spare_m", "planner_savings_test", "SeldomAsked.*"),
]
