#pragma once
/// From a scene as written to the smallest model that answers it.
///
/// Exact reductions change no result beyond rounding: positions, commands, reports.  Bounded ones change it
/// by no more than they say; only Fidelity::fastest, or a Choice of `on`, puts them in force.

#include <span>
#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace hamel::scene {

/// Makes the scene smaller and notes in Scene::reductions all that was considered, in force or not.  Pure:
/// the same scene gives the same model in every process.  `s` must be valid; reducing twice changes nothing
/// more.
///
///   fixed      exact, always: links behind fixed joints are lumped by the reader
///   locked     exact: locked joints frozen into composite inertias (locked.h)
///   plane      exact: SE(2) where all revolute axes are parallel and all slides across them
///   gravity    exact: zero where it works on no joint, that is parallel to every revolute axis and across
///              every slide; the potential energy loses its constant
///   terms      exact: stop torques are not evaluated where there are no stops
///   self       exact: pairs of links are passed over while they cannot have come near each other
///   obstacles  exact: those that never matter (reach.h) are dropped from each set as it arrives
///   links      exact in all but one thing, so only for `fastest`: links that no obstacle comes near are not
///              asked for distances and report none
///   shapes     bounded [m]: links as fewer and simpler solids, outward (outward.h)
///   merge      bounded [m]: obstacles of a set put together, outward (outward.h)
///   requery    bounded [m]: links out of range are asked for distances when they may have gone so far;
///              commands stay the same, reported distances are off.  Only where it is `on`
///   rate       bounded [m]: scripted obstacles are published no faster than carrying them on needs
///   cycle      bounded [m]: planner cycles no faster than needed for nothing to close in by more between
///              two that are farther apart than as written, and as often as written while a point of the arm
///              is faster than 1.5 times what the end effector is drawn with (cadence.h).  The bound is that
///              of twice that speed and of the scripted obstacles': it holds as long as no point of the arm
///              gains more speed in one written period than that speed times how many were put together.
///              Only where it is `on`
///   step       bounded [rad]: named here, chosen by those who may run the scene (clients/hamel)
void reduce(Scene& s);

/// A reduction of `reduce { }` by the name of its field.
struct NamedChoice {
  const char* name;
  Choice ReduceOptions::*choice;
};
std::span<const NamedChoice> choices() noexcept;

/// What was asked for by `on`, or tier and step for the accuracy by `fidelity: fastest`, and is not in force:
/// "merge: no capsules around ...", name and reason.
std::vector<std::string> refused(const Scene& s);

/// True where an option's reduction is to be in force.
bool wanted(const ReduceOptions& o, Choice choice, bool exact) noexcept;

/// The names of what is in force and did anything, "plane, obstacles"; "none" where nothing did.
std::string names_in_force(const Scene& s);

/// How far a swinging obstacle carried on with its velocity is off after `period_s`, at most: half its
/// largest acceleration times period^2 [m].
double carried_error_m(const ScriptedObstacle& o, double period_s) noexcept;

}  // namespace hamel::scene
