// Robots and streams from the world: all in urdf/ load, all in urdf_bad/ are refused for the reason in their
// name.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "common/files/scene_text.h"
#include "common/files/urdf.h"
#include "common/scene/stream.h"
#include "services/perception/core/source.h"
#include "tests/support/data.h"

namespace hamel::files {
namespace {

std::vector<std::string> files_in(const std::string& sub, const std::string& extension) {
  return test::files_in(test::data_folder() / sub, extension);
}

TEST(RobotsOfTheWorld, AllLoad) {
  HAMEL_NEEDS_DATA("urdf");
  const std::map<std::string, int> joints{
      {"double_pendulum_simple", 2}, {"gen3_7dof", 7}, {"iiwa14_spheres_collision", 7}, {"panda_arm", 7},
      {"panda_spherized", 7},        {"pendulum5", 5}, {"ur3e_spheres_collision", 6},   {"ur5_robot", 6}};
  for (const std::string& file : files_in("urdf", ".urdf")) {
    const auto robot = load_urdf(file);
    ASSERT_TRUE(robot) << to_string(robot.error().front());
    const auto expected = joints.find(std::filesystem::path(file).stem().string());
    if (expected != joints.end()) {
      EXPECT_EQ(robot.value().chain.n(), expected->second) << file;
    }
    for (int i = 0; i < robot.value().chain.n(); ++i)
      EXPECT_GT(robot.value().chain.link(i).inertia.mass_kg, 0) << file << " link " << i;
  }
}

TEST(RobotsOfTheWorld, BadOnesAreRefusedForTheReasonInTheirName) {
  HAMEL_NEEDS_DATA("urdf_bad");
  const std::map<std::string, std::string> reasons{{"inertia_not_positive", "not positive definite"},
                                                   {"tree_not_open_chain", "a tree, not an open chain"},
                                                   {"without_inertial", "no inertial"},
                                                   {"zero_inertia", "zero inertia"},
                                                   {"triangle_inequality", "triangle inequality"}};
  for (const std::string& file : files_in("urdf_bad", ".urdf")) {
    const auto robot = load_urdf(file);
    ASSERT_FALSE(robot) << file;
    const auto reason = std::find_if(reasons.begin(), reasons.end(),
                                     [&](const auto& r) { return file.find(r.first) != std::string::npos; });
    ASSERT_NE(reason, reasons.end()) << file << ": no reason is known for this name";
    EXPECT_TRUE(
        std::any_of(robot.error().begin(), robot.error().end(),
                    [&](const Problem& p) { return p.what.find(reason->second) != std::string::npos; }))
        << file << ": not among the problems: " << reason->second;
    for (const Problem& p : robot.error()) EXPECT_TRUE(p.where.starts_with(file + ":")) << to_string(p);
  }
}

TEST(RobotsOfTheWorld, PandaOfOursHasTheMakersKinematics) {
  HAMEL_NEEDS_DATA("urdf/panda_arm.urdf");
  const auto theirs = load_urdf((test::data_folder() / "urdf/panda_arm.urdf").string());
  const auto ours = load_urdf(std::string(HAMEL_SOURCE_DIR) + "/deploy/robots/panda.urdf");
  ASSERT_TRUE(theirs && ours);
  for (int i = 0; i < 7; ++i) {
    const model::Joint &a = ours.value().chain.joint(i), &b = theirs.value().chain.joint(i);
    EXPECT_LT((a.X_PJ.p - b.X_PJ.p).norm() + (a.X_PJ.R - b.X_PJ.R).norm(), 1e-5) << i;
    EXPECT_EQ(a.limits.lower, b.limits.lower);
    EXPECT_EQ(a.limits.upper, b.limits.upper);
    EXPECT_EQ(a.limits.effort, b.limits.effort);
    EXPECT_EQ(a.limits.acceleration, b.limits.acceleration);
  }
}

TEST(StreamsOfTheWorld, AllAreReadAndSampledInOrder) {
  HAMEL_NEEDS_DATA("streams");
  for (const std::string& file : files_in("streams", ".csv")) {
    const auto text = read_file(file);
    ASSERT_TRUE(text);
    auto samples = scene::parse_stream(text.value(), file);
    ASSERT_TRUE(samples) << to_string(samples.error().front());
    scene::PerceptionOptions options;
    options.stream.emplace().samples = samples.value();
    const auto source = perception::Source::make(options);
    ASSERT_TRUE(source) << to_string(source.error().front());
    std::vector<geometry::Obstacle> now;
    double last = -1;
    for (double t = 0; t < 1e4; last = t, t = source.value().next_time(t)) {
      ASSERT_GT(t, last);
      ASSERT_TRUE(source.value().at(t, now)) << t;
      for (const geometry::Obstacle& o : now) ASSERT_TRUE(o.X_WO.p.allFinite() && o.V_WO.allFinite());
    }
    EXPECT_GT(last, samples.value().back().t_s) << file;
    EXPECT_TRUE(now.empty());
  }
}

}  // namespace
}  // namespace hamel::files
