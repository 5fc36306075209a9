#pragma once
/// What reduce() writes down of each reduction; shared by its two files.

#include <string>

#include "common/scene/scene.h"

namespace hamel::scene {

inline std::string count(std::size_t k, const std::string& of) { return of + ": " + std::to_string(k); }

/// A new entry of Scene::reductions; the reference holds until the next.
inline Reduction& note(Scene& s, const std::string& name, bool in_force, const std::string& what,
                       const std::string& why) {
  Reduction r;
  r.name = name;
  r.in_force = in_force;
  r.what = what;
  r.why = why;
  s.reductions.push_back(std::move(r));
  return s.reductions.back();
}

inline void sizes(Reduction& r, double before, double after, const std::string& unit) {
  r.before = before;
  r.after = after;
  r.unit = unit;
}

/// Why what is done for `fidelity: fastest` alone, and now not wanted, is not done.
inline std::string unwanted(Choice choice, const std::string& would = "") {
  return choice == Choice::off ? "forbidden" : "fidelity: fastest would" + would;
}

/// The scene's obstacles that stand still, as perception will publish them.
std::vector<geometry::Obstacle> standing(const Scene& s);

/// The bounded part of reduce(): shapes, merge, requery, rate, cycle, step.
void reduce_shapes(Scene& s);
void reduce_bounded(Scene& s);

}  // namespace hamel::scene
