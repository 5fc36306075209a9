#pragma once
/// Joints that do not move: which they are, and the smaller arm that is left without them.

#include <vector>

#include "common/scene/scene.h"

namespace hamel::scene {

/// Rotor inertia that holds a locked joint where it is kept (reduce { locked: off }) [kg m^2 or kg]: a torque
/// of 1e3 moves it by less than 1e-12 in a day.
inline constexpr double kHeldArmature = 1e25;

/// Where each joint of the arm as written stays; none: it moves.  Named in Scene::locked, or its limits leave
/// it one value.
std::vector<std::optional<double>> locked_values(const Scene& s);

/// What is wrong with Scene::locked: no such joint, named twice, a value outside its limits or unlike q0, a
/// velocity, a goal elsewhere, nothing left that moves.  Empty where sizes are wrong, which others say.
Problems lock_problems(const Scene& s);

/// Takes the locked joints out of robot, q0, qd0 and goal: each link they carry becomes part of the one
/// before it (of the base, where it is the first): mass, centre, inertia, shapes, end effector.  Exact: the
/// other joints move as under the constraint, and shapes are measured against the same obstacles as before
/// (LinkShape::was_link).  Links keep the name of the part next to the base.
void freeze(Scene& s, const std::vector<std::optional<double>>& at);
/// Keeps them and holds them by kHeldArmature.
void hold(Scene& s, const std::vector<std::optional<double>>& at);

/// Two bodies in the axes of one frame as one.
model::Inertia together(const model::Inertia& a, const model::Inertia& b);

}  // namespace hamel::scene
