// What a scene asks for, forces or forbids is so, and what cannot be done is said.
#include <gtest/gtest.h>

#include <string>

#include "common/scene/reduce.h"
#include "tests/support/reduce_scene.h"

namespace hamel::scene {
namespace {

using test::find;

TEST(Reductions, AreForbiddenAndForced) {
  test::Random rng(11);
  Scene s = test::random_scene(rng, true, 0.4);
  s.robot.fixed_joints = 0;
  Scene full = s, forced = s, forbidden = s;
  full.reduce.fidelity = Fidelity::full;
  reduce(full);
  EXPECT_EQ(names_in_force(full), "none");
  EXPECT_EQ(full.dynamics.space, Space::se3);
  forced.reduce.fidelity = Fidelity::full;
  forced.reduce.plane = Choice::on;
  reduce(forced);
  EXPECT_EQ(names_in_force(forced), "plane");
  forbidden.reduce.obstacles = Choice::off;
  reduce(forbidden);
  EXPECT_FALSE(find(forbidden, "obstacles").in_force);
  EXPECT_TRUE(find(forbidden, "plane").in_force);
  const auto once = forbidden.reductions.size();
  reduce(forbidden);
  EXPECT_EQ(forbidden.reductions.size(), once) << "twice changes nothing more";
}

TEST(Reductions, ThatAreForbiddenSaySo) {
  test::Random rng(61);
  for (const Fidelity fidelity : {Fidelity::exact, Fidelity::fastest})
    for (const char* name : {"shapes", "links", "merge", "rate", "step"}) {
      Scene s = test::random_scene(rng, true, 0);
      s.steered = true;
      s.perception.rate_hz = 1e4;  // more than any motion needs
      s.reduce.fidelity = fidelity;
      for (const NamedChoice& c : choices())
        if (name == std::string(c.name)) s.reduce.*c.choice = Choice::off;
      reduce(s);
      EXPECT_FALSE(find(s, name).in_force) << name;
      EXPECT_EQ(find(s, name).why, "forbidden") << name;
    }
}

TEST(Asked, ForWhatCannotBeDoneIsSaid) {
  test::Random rng(5);
  Scene s = test::random_scene(rng, false, 0);
  s.perception.obstacles.clear();
  s.robot.self_pairs.clear();
  s.robot.shapes.clear();
  s.planner.vmax_mps = kInf;
  for (const NamedChoice& c : choices()) s.reduce.*c.choice = Choice::on;
  const auto said = [](const Scene& of, const std::string& name) {
    for (const std::string& line : refused(of))
      if (line.starts_with(name + ": ")) return line.size() > name.size() + 5;
    return false;
  };
  Scene reduced = s;
  EXPECT_TRUE(refused(reduced).empty()) << "not reduced yet";
  reduce(reduced);
  for (const char* name : {"locked", "plane", "self", "links", "shapes", "merge", "cycle", "step"})
    EXPECT_TRUE(said(reduced, name)) << name;
  for (const char* name : {"obstacles", "requery"}) EXPECT_FALSE(said(reduced, name)) << name;
  for (const NamedChoice& c : choices()) s.reduce.*c.choice = Choice::off;
  reduced = s;
  reduce(reduced);
  EXPECT_TRUE(refused(reduced).empty()) << "nothing was asked for";
  s.steered = false;
  s.reduce.merge = Choice::on;
  reduce(s);
  EXPECT_EQ(refused(s), std::vector<std::string>{"merge: the scene is not steered"});
}

}  // namespace
}  // namespace hamel::scene
