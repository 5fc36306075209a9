// Scenes from text: every shipped one loads, every bad line is named with its place.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>

#include "common/files/scene_text.h"

namespace hamel::files {
namespace {

using Overrides = std::vector<std::string>;
const std::string kScenes = std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes/";
const std::string kRobot =
    "robot { urdf: \"" + std::string(HAMEL_SOURCE_DIR) + "/deploy/robots/four_link_planar.urdf\" }\n";

/// A file that is gone with its test.
class Scratch {
 public:
  explicit Scratch(const std::string& text, const std::string& name = "scene.textproto")
      : folder_(std::filesystem::temp_directory_path() /
                ("hamel_files_" + std::to_string(::getpid()) + "_" + std::to_string(count_++))) {
    std::filesystem::create_directories(folder_);
    add(name, text);
    path_ = (folder_ / name).string();
  }
  ~Scratch() { std::filesystem::remove_all(folder_); }
  void add(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  const std::string& path() const { return path_; }

 private:
  static inline int count_ = 0;
  std::filesystem::path folder_;
  std::string path_;
};

/// The problems of a text, each as "line:column: what" or "--set ...: what".
std::vector<std::string> problems_of(const std::string& text, const Overrides& overrides = {}) {
  const Scratch file(text);
  const auto scene = load_scene(file.path(), overrides);
  std::vector<std::string> out;
  if (scene) return out;
  for (const Problem& p : scene.error()) {
    std::string line = to_string(p);
    if (line.starts_with(file.path() + ":")) line.erase(0, file.path().size() + 1);
    out.push_back(line);
  }
  return out;
}

void expect_problem(const std::vector<std::string>& all, const std::string& begin) {
  for (const std::string& p : all)
    if (p.starts_with(begin)) return;
  std::string seen;
  for (const std::string& p : all) seen += "\n  " + p;
  ADD_FAILURE() << "missing: " << begin << " in" << seen;
}

TEST(SceneText, EveryShippedSceneLoads) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kScenes)) {
    const auto scene = load_scene(entry.path().string());
    ASSERT_TRUE(scene) << to_string(scene.error().front());
    EXPECT_EQ(scene.value().name, entry.path().stem().string());
    EXPECT_TRUE(scene::warnings(scene.value()).empty()) << scene::warnings(scene.value()).front();
    ++count;
  }
  EXPECT_GE(count, 6);
}

TEST(SceneText, FourLinkAvoidIsSetS1) {
  const auto scene = load_scene(kScenes + "four_link_avoid.textproto");
  ASSERT_TRUE(scene);
  const scene::Scene& s = scene.value();
  EXPECT_EQ(s.planner.method, scene::Method::gyro_paper);
  EXPECT_EQ(s.planner.gain_form, scene::GainForm::F2);
  EXPECT_EQ(s.planner.mapping, scene::Mapping::paper);
  EXPECT_EQ(s.planner.pairs, scene::PairPolicy::nearest);
  EXPECT_FALSE(s.planner.relative_velocity);
  EXPECT_FALSE(s.planner.lambda2_relative);
  EXPECT_EQ(s.planner.kp, 25);
  EXPECT_EQ(s.planner.kv, 20);
  EXPECT_EQ(s.planner.damping, 2);
  EXPECT_EQ(s.planner.kobs, 4);
  EXPECT_EQ(s.planner.lambda2, 1e-3);
  EXPECT_EQ(s.planner.phi_min_rad, 1.0 / 3);
  EXPECT_EQ(s.planner.rho0_m, 0.5);
  EXPECT_EQ(s.duration_s, 30);
  EXPECT_EQ(s.stop, scene::StopRule::at_duration);
  EXPECT_TRUE(s.robot.chain.gravity_W_mps2().isZero(0));
  ASSERT_EQ(s.robot.shapes.size(), 4u);
  for (const scene::LinkShape& shape : s.robot.shapes) {
    EXPECT_EQ(shape.shape.kind, geometry::ShapeKind::capsule);
    EXPECT_EQ(shape.shape.dims_m[0], 0);
    EXPECT_EQ(shape.shape.dims_m[1], 1);
  }
  ASSERT_EQ(s.perception.obstacles.size(), 1u);
  EXPECT_EQ(s.perception.obstacles[0].at_start.X_WO.p, Eigen::Vector3d(2.4, 2.2, 0));
}

TEST(SceneText, DefaultsAreThoseOfTheOptions) {
  const Scratch file(kRobot);
  const auto scene = read_scene(file.path());
  ASSERT_TRUE(scene) << to_string(scene.error().front());
  const scene::Scene& s = scene.value();
  EXPECT_EQ(s.planner.kv, scene::PlannerOptions{}.kv);
  EXPECT_EQ(s.dynamics.dt_s, scene::DynamicsOptions{}.dt_s);
  EXPECT_EQ(s.robot.chain.gravity_W_mps2(), Eigen::Vector3d(0, 0, -9.81));
  EXPECT_EQ(s.q0, Eigen::VectorXd::Zero(4));
  EXPECT_EQ(s.arm, 1u);
  EXPECT_TRUE(s.steered);
  EXPECT_FALSE(s.goal);
  EXPECT_EQ(s.bus.planner, "");
  EXPECT_EQ(s.text, kRobot);
}

TEST(SceneText, EveryNumberOfTheOptionsCanBeSet) {
  const Scratch file(kRobot);
  const auto text = read_file(std::string(HAMEL_SOURCE_DIR) + "/common/scene/options.h");
  ASSERT_TRUE(text);
  const std::regex member("\n  (double|int) (\\w+) = ");
  const auto begin = [&](const char* name) { return text.value().find(name); };
  const std::size_t planner = begin("struct PlannerOptions"), accuracy = begin("struct Accuracy");
  int count = 0;
  for (std::sregex_iterator m(text.value().begin(), text.value().end(), member), end; m != end;
       ++m, ++count) {
    const auto at = static_cast<std::size_t>(m->position());
    const std::string part = at < planner ? "dynamics." : at < accuracy ? "planner." : "accuracy.";
    const std::string set = part + m->str(2) + "=-7";  // breaks a rule of every one of them
    const auto scene = load_scene(file.path(), {set});
    ASSERT_FALSE(scene) << set;
    EXPECT_NE(scene.error().front().what.find(part + m->str(2) + " = -7, must be"), std::string::npos)
        << to_string(scene.error().front());
  }
  EXPECT_GE(count, 35);
}

TEST(SceneText, EnumerationsHaveTheNamesOfTheOptions) {
  const Scratch file(kRobot);
  const auto with = [&](const std::string& set) {
    auto scene = load_scene(file.path(), {set});
    EXPECT_TRUE(scene) << set;
    return std::move(scene).value();
  };
  for (int i = 0; i < 6; ++i) {
    const auto v = static_cast<scene::Tier>(i);
    EXPECT_EQ(with(std::string("dynamics.tier=") + to_string(v)).dynamics.tier, v);
  }
  for (int i = 0; i < 3; ++i) {
    const auto root = static_cast<scene::Root>(i);
    EXPECT_EQ(with(std::string("dynamics.root=") + to_string(root)).dynamics.root, root);
  }
  for (int i = 0; i < 2; ++i) {
    const auto start = static_cast<scene::Start>(i);
    const auto space = static_cast<scene::Space>(i);
    const auto pairs = static_cast<scene::PairPolicy>(i);
    const auto stop = static_cast<scene::StopRule>(i);
    EXPECT_EQ(with(std::string("dynamics.start=") + to_string(start)).dynamics.start, start);
    EXPECT_EQ(with(std::string("dynamics.space=") + to_string(space)).dynamics.space, space);
    EXPECT_EQ(with(std::string("planner.pairs=") + to_string(pairs)).planner.pairs, pairs);
    EXPECT_EQ(with(std::string("stop=") + to_string(stop)).stop, stop);
  }
  for (int i = 0; i < 4; ++i) {
    const auto method = static_cast<scene::Method>(i);
    const auto form = static_cast<scene::GainForm>(i);
    EXPECT_EQ(with(std::string("planner.method=") + to_string(method)).planner.method, method);
    EXPECT_EQ(with(std::string("planner.gain_form=") + to_string(form)).planner.gain_form, form);
  }
  for (int i = 0; i < 3; ++i) {
    const auto mapping = static_cast<scene::Mapping>(i);
    EXPECT_EQ(with(std::string("planner.mapping=") + to_string(mapping)).planner.mapping, mapping);
  }
}

TEST(SceneText, EveryBadLineIsNamedAtItsPlace) {
  const auto all = problems_of(kRobot +
                               "planner { kq: 3\n"
                               "\tmethod: foo kp: abc\n"
                               "  kv: -2 mapping: paper }\n"
                               "dynamics { dt_s: -1 tier: 17 alpha: nan }\n"
                               "goal { position_m: [1, 2] }\n"
                               "perception { obstacles { sphere { radius_m: -1 } position_m: [0, 0, 0] }\n"
                               "  obstacles { position_m: [0, 0, 0] }\n"
                               "  stream { path: \"none.csv\" } }\n"
                               "duration_s: 0 zzz: 4\n"
                               "q0: [0, 0, x, 0]\n"
                               "steered: maybe\n");
  expect_problem(all, "2:11: unknown field \"kq\"; Planner has method, ");
  expect_problem(all, "3:17: method = foo, must be one of attract, khatib, gyro_paper, gyro");
  expect_problem(all, "3:25: Expected double, got: abc");
  expect_problem(all, "4:3: planner.kv = -2, must be > 0");
  expect_problem(all, "5:12: dynamics.dt_s = -1, must be > 0");
  expect_problem(all, "5:27: tier = 17, must be one of hamel, ");
  expect_problem(all, "5:30: dynamics.alpha = nan, must be in [0, 1]");
  expect_problem(all, "6:8: goal.position_m has 2 numbers, must have 3");
  expect_problem(all, "7:35: perception.obstacles[0].sphere.radius_m = -1");
  expect_problem(all, "8:3: perception.obstacles[1].shape is missing");
  expect_problem(all, "9:12: perception.stream.path = ");
  expect_problem(all, "10:1: duration_s = 0, must be > 0");
  expect_problem(all, "10:15: unknown field \"zzz\"");
  expect_problem(all, "11:12: Expected double, got: x");
  expect_problem(all, "12:10: Invalid value for boolean field \"steered\"");
  for (const std::string& p : all)
    EXPECT_EQ(p.find("kp ="), std::string::npos) << "a bad value is named once: " << p;
}

TEST(SceneText, BrokenSyntaxEndsWithItsPlace) {
  expect_problem(problems_of("robot { urdf: \"x\"\nplanner }"), "2:");
  expect_problem(problems_of("robot {\n  urdf \"x\" }"), "2:");
  expect_problem(problems_of("duration_s: 1\nduration_s: 2\n"), "2:");
  expect_problem(problems_of("\x01\x02\xff"), "1:1");
  expect_problem(problems_of(""), "1:1: robot.urdf is missing");
}

TEST(SceneText, ShapesAndMotionsAreComplete) {
  const std::string obstacle = "perception { obstacles {\n";
  expect_problem(problems_of(kRobot + obstacle + "sphere {} position_m: [0,0,0] } }"),
                 "3:1: perception.obstacles[0].sphere.radius_m is missing");
  expect_problem(problems_of(kRobot + obstacle + "sphere { radius_m: 1 } } }"),
                 "2:14: perception.obstacles[0].position_m is missing");
  expect_problem(problems_of(kRobot + obstacle + "sphere { radius_m: 1 } box { size_m: [1,1,1] } } }"), "3:");
  expect_problem(problems_of(kRobot + obstacle +
                             "sphere { radius_m: 1 } position_m: [0,0,0] velocity_mps: [1,0,0]\n"
                             "sinusoid { amplitude_m: [1,0,0] frequency_hz: 1 } } }"),
                 "4:1: perception.obstacles[0].sinusoid stands beside velocity_mps");
  EXPECT_TRUE(problems_of(kRobot + obstacle + "half_space {} } }").empty());
  EXPECT_TRUE(problems_of(kRobot + obstacle +
                          "capsule { radius_m: 1 length_m: 2 } position_m: [9,9,9] rpy_rad: [1,2,3] } }")
                  .empty());
}

TEST(SceneText, GoalIsOfOneKind) {
  EXPECT_TRUE(problems_of(kRobot + "goal { joints: [0, 0.1, 0.2, 0.3] }").empty());
  EXPECT_TRUE(problems_of(kRobot + "goal { position_m: [1, 1, 0] rpy_rad: [0, 0, 1] }").empty());
  expect_problem(problems_of(kRobot + "goal { joints: [0, 0, 0, 0] position_m: [1, 1, 0] }"),
                 "2:8: goal.joints stands beside");
  expect_problem(problems_of(kRobot + "goal { }"), "2:1: goal.position_m is missing");
}

TEST(SceneText, StreamIsReadAndItsBadLinesNamed) {
  const Scratch file(kRobot + "perception { stream { path: \"a.csv\" scale: 2 } }");
  file.add("a.csv", "t_s,id,x_m,y_m,z_m,radius_m\n3,0,1,2,3,0.1\n");
  const auto good = load_scene(file.path());
  ASSERT_TRUE(good) << to_string(good.error().front());
  EXPECT_EQ(good.value().perception.stream->samples.size(), 1u);
  EXPECT_EQ(good.value().perception.stream->start_s, 3);
  file.add("a.csv", "t_s,id,x_m,y_m,z_m,radius_m\n3,0,1,2,3,0.1\n2,0,1,2,3,0.1\n");
  const auto bad = load_scene(file.path());
  ASSERT_FALSE(bad);
  EXPECT_TRUE(bad.error().front().where.ends_with("a.csv:3")) << bad.error().front().where;
}

TEST(SceneText, MissingFilesAreNamed) {
  const auto none = load_scene("/nowhere/scene.textproto");
  ASSERT_FALSE(none);
  EXPECT_EQ(to_string(none.error().front()), "/nowhere/scene.textproto: no such file");
  ASSERT_FALSE(load_scene(kScenes));
  expect_problem(problems_of("robot { urdf: \"gone.urdf\" }"), "1:9: robot.urdf = ");
  const auto all = problems_of("robot { urdf: \"gone.urdf\" }\nduration_s: -1 q0: [1]");
  expect_problem(all, "2:1: duration_s = -1");
  EXPECT_EQ(all.size(), 2u) << "rules about joints need a robot";
}

TEST(Overrides, ReplaceValuesOfEveryType) {
  const Overrides sets{"planner.method=gyro",
                       "dynamics.dt_s=2e-3",
                       "q0[1]=0.5",
                       "planner.bus=fastdds",
                       "name=foo bar",
                       "perception.obstacles[0].sphere.radius_m=0.125",
                       "perception.obstacles.0.id=9",
                       "perception.obstacles[1]={ box { size_m: [1, 1, 1] } position_m: [9, 9, 9] }",
                       "goal={ joints: [0, 1, 2, 3] }",
                       "steered=true",
                       "planner.vmax_mps=inf",
                       "arm=3",
                       "dynamics.bus=\"cyclonedds\"",
                       "gravity_mps2=[0, 0, -1]"};
  const auto scene = read_scene(kScenes + "four_link_avoid.textproto", sets);
  ASSERT_TRUE(scene) << to_string(scene.error().front());
  const scene::Scene& s = scene.value();
  EXPECT_EQ(s.planner.method, scene::Method::gyro);
  EXPECT_EQ(s.dynamics.dt_s, 2e-3);
  EXPECT_EQ(s.q0, Eigen::Vector4d(0, 0.5, 0, 0));
  EXPECT_EQ(s.bus.planner, "fastdds");
  EXPECT_EQ(s.bus.dynamics, "cyclonedds");
  EXPECT_EQ(s.name, "foo bar");
  ASSERT_EQ(s.perception.obstacles.size(), 2u);
  EXPECT_EQ(s.perception.obstacles[0].at_start.id, 9u);
  EXPECT_EQ(s.perception.obstacles[0].at_start.shape.dims_m[0], 0.125);
  EXPECT_EQ(s.perception.obstacles[1].at_start.shape.kind, geometry::ShapeKind::box);
  EXPECT_EQ(s.goal->kind, scene::GoalKind::joints);
  EXPECT_EQ(s.arm, 3u);
  EXPECT_EQ(s.robot.chain.gravity_W_mps2(), Eigen::Vector3d(0, 0, -1));
  EXPECT_NE(s.text.find("fastdds"), std::string::npos) << "recordings keep the overridden text";
  EXPECT_EQ(s.planner.kp, 25) << "the rest stays";
}

TEST(Overrides, LaterOneWins) {
  const auto scene = load_scene(kScenes + "four_link_avoid.textproto", {"planner.kp=1", "planner.kp=2"});
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene.value().planner.kp, 2);
}

TEST(Overrides, BadOnesAreNamedAsWritten) {
  const auto with = [](const std::string& set) { return problems_of(kRobot, {set}); };
  expect_problem(with("dynamics.dt_s=-1"), "--set dynamics.dt_s=-1: dynamics.dt_s = -1, must be > 0");
  expect_problem(with("planner.kk=1"), "--set planner.kk=1: unknown field \"kk\"");
  expect_problem(with("planner.method=foo"),
                 "--set planner.method=foo: method = foo, must be one of attract");
  expect_problem(with("planner.bus=ros"), "--set planner.bus=ros: planner.bus = \"ros\", must be inproc");
  expect_problem(with("q0[3]=1"), "--set q0[3]=1: index 3 is past the end");
  expect_problem(with("q0[0]=1"), "--set q0[0]=1: q0 has 1 values");
  expect_problem(with("perception.obstacles.id=1"), "--set perception.obstacles.id=1: obstacles is a list");
  expect_problem(with("planner[0].kp=1"), "--set planner[0].kp=1: planner is not a list");
  expect_problem(with("duration_s.x=1"), "--set duration_s.x=1: duration_s has no fields");
  expect_problem(with("planner.kp"), "--set planner.kp: must be field=value");
  expect_problem(with("=3"), "--set =3: must name a field");
  expect_problem(with("planner.kp="), "--set planner.kp=: ");
  expect_problem(with("steered=perhaps"), "--set steered=perhaps: ");
  expect_problem(with("robot.urdf=gone.urdf"), "--set robot.urdf=gone.urdf: robot.urdf = ");
}

}  // namespace
}  // namespace hamel::files
