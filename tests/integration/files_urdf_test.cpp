// Robots from URDF text: what is lumped, what is kept, what is refused and by which name.
#include "common/files/urdf.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>

namespace hamel::files {
namespace {

const std::string kUnit = "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>";

std::string inertial(const std::string& mass, const std::string& inertia = kUnit,
                     const std::string& origin = "") {
  return "<inertial>" + origin + "<mass value='" + mass + "'/>" + inertia + "</inertial>";
}

std::string link(const std::string& name, const std::string& inside = inertial("1")) {
  return "<link name='" + name + "'>" + inside + "</link>\n";
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& inside = "<axis xyz='0 0 1'/>") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" +
         child + "'/>" + inside + "</joint>\n";
}

std::string robot(const std::string& inside) { return "<robot name='r'>\n" + inside + "</robot>"; }

/// base - j1 - a - ...
std::string arm(const std::string& more = "", const std::string& a = inertial("1")) {
  return robot(link("base", "") + joint("j1", "continuous", "base", "a") + link("a", a) + more);
}

scene::Robot load(const std::string& text, const RobotPlace& place = {}, const std::string& spheres = {}) {
  auto r = parse_urdf(text, "r.urdf", place, spheres);
  if (r) return std::move(r).value();
  std::string all;
  for (const Problem& p : r.error()) all += to_string(p) + "\n";
  throw std::runtime_error(all);
}

void expect_refused(const std::string& text, const std::string& where, const std::string& what,
                    const RobotPlace& place = {}) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const auto r = parse_urdf(text, "r.urdf", place);
  EXPECT_EQ(testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr(), "")
      << "must be quiet";
  ASSERT_FALSE(r) << what;
  std::string all;
  for (const Problem& p : r.error()) {
    if (p.where.find(where) != std::string::npos && p.what.find(what) != std::string::npos) return;
    all += "\n  " + to_string(p);
  }
  ADD_FAILURE() << "missing: " << where << ": " << what << " in" << all;
}

bool warned(const scene::Robot& r, const std::string& text) {
  return std::any_of(r.warnings.begin(), r.warnings.end(),
                     [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

TEST(Urdf, SmallestArmIsRead) {
  const scene::Robot r = load(arm());
  EXPECT_EQ(r.chain.n(), 1);
  EXPECT_EQ(r.name, "r");
  EXPECT_EQ(r.chain.joint(0).name, "j1");
  EXPECT_EQ(r.chain.joint(0).kind, model::JointKind::continuous);
  EXPECT_EQ(r.chain.spec().tip_name, "a");
  EXPECT_TRUE(warned(r, "no collision shape"));
}

TEST(Urdf, EveryJointKindAndItsFiguresAreRead) {
  const std::string limit = "<limit lower='-1' upper='2' effort='3' velocity='4' drake:acceleration='5'/>";
  const scene::Robot r = load(
      robot(link("base", "") +
            joint("slide", "prismatic", "base", "a", "<axis xyz='0 1 0'/><origin xyz='1 2 3'/>" + limit) +
            link("a") +
            joint("turn", "revolute", "a", "b", "<axis xyz='1 0 0'/>" + limit + "<dynamics damping='0.5'/>") +
            link("b")));
  EXPECT_EQ(r.chain.joint(0).kind, model::JointKind::prismatic);
  EXPECT_EQ(r.chain.joint(0).X_PJ.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(r.chain.joint(0).axis, Eigen::Vector3d::UnitY());
  const model::JointLimits& l = r.chain.joint(1).limits;
  EXPECT_EQ(r.chain.joint(1).kind, model::JointKind::revolute);
  EXPECT_EQ(r.chain.joint(1).damping, 0.5);
  EXPECT_EQ(std::vector({l.lower, l.upper, l.effort, l.velocity, l.acceleration}),
            std::vector<double>({-1, 2, 3, 4, 5}));
}

TEST(Urdf, InertialOriginIsRotated) {
  const double yaw = 0.7, roll = 0.3;
  const scene::Robot r =
      load(arm("", inertial("2", "<inertia ixx='1' ixy='0' ixz='0' iyy='2' iyz='0' izz='2.5'/>",
                            "<origin xyz='1 0 0' rpy='0.3 0 0.7'/>")));
  const Eigen::Matrix3d R =
      (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const Eigen::Matrix3d expected = R * Eigen::Vector3d(1, 2, 2.5).asDiagonal() * R.transpose();
  EXPECT_LT((r.chain.link(0).inertia.about_com_kgm2 - expected).norm(), 1e-14);
  EXPECT_EQ(r.chain.link(0).inertia.com_m, Eigen::Vector3d(1, 0, 0));
}

TEST(Urdf, FixedLinksAreLumpedIntoWhatCarriesThem) {
  // Two point-like masses of 1 and 3 kg, 2 m apart along the turned x axis of the fixed joint.
  const scene::Robot r =
      load(arm(joint("f", "fixed", "a", "b", "<origin xyz='0 2 0' rpy='0 0 1.5707963267948966'/>") +
               link("b", inertial("3", kUnit, "<origin xyz='0 1 0'/>"))));
  const model::Inertia& I = r.chain.link(0).inertia;  // b's centre: (0,2,0) + Rz(90) (0,1,0) = (-1,2,0)
  EXPECT_EQ(r.chain.n(), 1);
  EXPECT_EQ(I.mass_kg, 4);
  EXPECT_LT((I.com_m - Eigen::Vector3d(-0.75, 1.5, 0)).norm(), 1e-15);
  const Eigen::Vector3d d(-1, 2, 0);
  const Eigen::Matrix3d expected = 2 * Eigen::Matrix3d::Identity() +
                                   0.75 * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
  EXPECT_LT((I.about_com_kgm2 - expected).norm(), 1e-14);
  EXPECT_EQ(r.chain.spec().tip_name, "b");
  EXPECT_LT((r.chain.X_NE().p - Eigen::Vector3d(0, 2, 0)).norm(), 1e-15);
}

TEST(Urdf, FixedBaseLinksMoveTheFirstJoint) {
  const scene::Robot r = load(
      robot(link("world", "") + joint("f", "fixed", "world", "base", "<origin xyz='0 0 1'/>") + link("base") +
            joint("j1", "continuous", "base", "a", "<origin xyz='1 0 0'/><axis xyz='0 0 1'/>") + link("a")));
  EXPECT_EQ(r.chain.joint(0).X_PJ.p, Eigen::Vector3d(1, 0, 1));
}

TEST(Urdf, PlaceAndTipAreTaken) {
  RobotPlace place;
  place.tip = "left";
  place.X_WB0.p = {0, 0, 2};
  place.gravity_W_mps2 = {0, -1, 0};
  const std::string hands = joint("l", "fixed", "a", "left", "<origin xyz='0 1 0'/>") + link("left", "") +
                            joint("r", "fixed", "a", "right") + link("right", "");
  const scene::Robot r = load(arm(hands), place);
  EXPECT_EQ(r.chain.X_NE().p, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(r.chain.X_WB0().p, Eigen::Vector3d(0, 0, 2));
  EXPECT_EQ(r.chain.gravity_W_mps2(), Eigen::Vector3d(0, -1, 0));
  EXPECT_TRUE(warned(load(arm(hands)), "several links are fixed to it"));
  expect_refused(arm(hands), "robot", "end effector none: no such link", {"none", {}, {0, 0, 0}});
  expect_refused(arm(hands), "link base", "cannot be the end effector", {"base", {}, {0, 0, 0}});
}

TEST(Urdf, CylinderWithTwoSpheresIsACapsule) {
  const auto shape = [](const std::string& origin, const std::string& geometry) {
    return "<collision><origin " + origin + "/><geometry>" + geometry + "</geometry></collision>";
  };
  const std::string all =
      inertial("1") + shape("xyz='0 0 0'", "<sphere radius='0.1'/>") +
      shape("xyz='0.5 0 0' rpy='0 1.5707963267948966 0'", "<cylinder radius='0.1' length='1'/>") +
      shape("xyz='1 0 0'", "<sphere radius='0.1'/>") + shape("xyz='3 0 0'", "<sphere radius='0.1'/>") +
      shape("xyz='0 0 4'", "<cylinder radius='0' length='2'/>") +
      shape("xyz='0 0 5'", "<cylinder radius='0.2' length='2'/>") +
      shape("xyz='0 0 6'", "<box size='1 2 3'/>");
  const scene::Robot r = load(arm("", all));
  using geometry::ShapeKind;
  const std::vector kinds{ShapeKind::capsule, ShapeKind::sphere, ShapeKind::capsule, ShapeKind::cylinder,
                          ShapeKind::box};
  ASSERT_EQ(r.shapes.size(), kinds.size());
  for (std::size_t i = 0; i < kinds.size(); ++i) EXPECT_EQ(r.shapes[i].shape.kind, kinds[i]) << i;
  EXPECT_EQ(r.shapes[0].shape.dims_m[1], 1);
  EXPECT_LT((r.shapes[0].X_LS * Eigen::Vector3d(0, 0, 0.5) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(r.shapes[2].shape.dims_m[0], 0);
}

TEST(Urdf, MeshIsACapsuleAloudOrGivenSpheres) {
  const std::string mesh =
      inertial("1") + "<collision><geometry><mesh filename='a.stl'/></geometry></collision>";
  const std::string next =
      joint("j2", "continuous", "a", "b", "<origin xyz='0 0.3 0.4'/><axis xyz='0 0 1'/>");
  const scene::Robot fitted = load(arm(next + link("b"), mesh));
  EXPECT_TRUE(warned(fitted, "link a: collision mesh not read; a capsule of radius 0.2 m and length 0.5 m"));
  ASSERT_EQ(fitted.shapes.size(), 1u);
  const scene::LinkShape& capsule = fitted.shapes[0];
  EXPECT_EQ(capsule.shape.kind, geometry::ShapeKind::capsule);
  EXPECT_LT((capsule.X_LS * Eigen::Vector3d(0, 0, -0.25)).norm(), 1e-12);
  EXPECT_LT((capsule.X_LS * Eigen::Vector3d(0, 0, 0.25) - Eigen::Vector3d(0, 0.3, 0.4)).norm(), 1e-12);
  const std::string spheres = "link { name: 'a' spheres { center_m: [1, 2, 3] radius_m: 0.5 } }";
  const scene::Robot r = load(arm("", mesh), {}, spheres);
  EXPECT_TRUE(r.warnings.empty()) << r.warnings.front();
  ASSERT_EQ(r.shapes.size(), 1u);
  EXPECT_EQ(r.shapes[0].X_LS.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(
      warned(load(arm("", mesh), {}, "link { name: 'b' spheres { center_m: [1, 2, 3] radius_m: 0.5 } }"),
             "no such link"));
  const auto bad =
      parse_urdf(arm("", mesh), "r", {}, "link { name: 'a'\n spheres { center_m: [1, 2] radius_m: -1 } }");
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().size(), 2u);
  EXPECT_TRUE(bad.error()[0].where.starts_with("r spheres:2:2")) << bad.error()[0].where;
}

TEST(Urdf, JointsOutsideTheSubsetAreRefusedByName) {
  for (const char* type : {"floating", "planar", "spherical", ""})
    expect_refused(arm(joint("odd", type, "a", "b") + link("b")), "joint odd", "");
  expect_refused(arm(joint("odd", "floating", "a", "b") + link("b")), "r.urdf:5: joint odd",
                 "joint type floating is not supported");
  expect_refused(
      arm(joint("m", "continuous", "a", "b", "<axis xyz='0 0 1'/><mimic joint='j1'/>") + link("b")),
      "joint m", "mimic");
}

TEST(Urdf, BadJointsAreRefusedByName) {
  const auto with = [](const std::string& type, const std::string& inside) {
    return arm(joint("j2", type, "a", "b", inside) + link("b"));
  };
  const std::string z = "<axis xyz='0 0 1'/>";
  expect_refused(with("revolute", z), "joint j2", "has no limit");
  expect_refused(with("revolute", z + "<limit effort='1' velocity='1'/>"), "joint j2",
                 "neither lower nor upper");
  expect_refused(with("revolute", z + "<limit lower='0' upper='1' velocity='1'/>"), "joint j2",
                 "limit has no effort");
  expect_refused(with("revolute", z + "<limit lower='0' upper='1' effort='1'/>"), "joint j2",
                 "limit has no velocity");
  expect_refused(with("prismatic", z + "<limit lower='2' upper='1' effort='1' velocity='1'/>"), "joint j2",
                 "limits crossed");
  expect_refused(with("revolute", z + "<limit lower='nan' upper='1' effort='1' velocity='1'/>"), "joint j2",
                 "lower = \"nan\"");
  expect_refused(with("revolute", z + "<limit lower='0' upper='1' effort='-1' velocity='1'/>"), "joint j2",
                 "effort limit = -1");
  expect_refused(with("continuous", z + "<limit effort='1' velocity='-2'/>"), "joint j2",
                 "velocity limit = -2");
  expect_refused(with("continuous", "<axis xyz='0 0 0'/>"), "joint j2", "must be a unit vector");
  expect_refused(with("continuous", "<axis xyz='0 0 2'/>"), "joint j2", "must be a unit vector");
  expect_refused(with("continuous", "<axis xyz='0 1'/>"), "joint j2", "three numbers");
  expect_refused(with("continuous", "<axis xyz='0 0 inf'/>"), "joint j2", "finite");
  expect_refused(with("continuous", "<axis/>"), "joint j2", "axis has no xyz");
  expect_refused(with("continuous", z + "<origin xyz='0 0 1e400'/>"), "joint j2", "origin xyz");
  expect_refused(with("continuous", z + "<origin rpy='0 0'/>"), "joint j2", "origin rpy");
  expect_refused(with("continuous", z + "<dynamics damping='-1'/>"), "joint j2", "damping = -1");
  expect_refused(with("continuous", z + "<dynamics damping='x'/>"), "joint j2", "damping = \"x\"");
}

TEST(Urdf, BadInertiasAreRefusedByLink) {
  const auto with = [](const std::string& inside) { return arm("", inside); };
  expect_refused(with(inertial("-1")), "link a", "mass = -1 kg");
  expect_refused(with(inertial("nan")), "link a", "value = \"nan\"");
  expect_refused(with("<inertial><mass/>" + kUnit + "</inertial>"), "link a", "mass has no value");
  expect_refused(with("<inertial>" + kUnit + "</inertial>"), "link a", "inertial has no mass");
  expect_refused(with("<inertial><mass value='1'/></inertial>"), "link a", "inertial has no inertia");
  expect_refused(with(inertial("1", "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0'/>")), "link a",
                 "inertia has no iyz");
  expect_refused(with(inertial("1", "<inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/>")), "link a",
                 "zero inertia");
  expect_refused(with(inertial("1", "<inertia ixx='1' ixy='2' ixz='0' iyy='1' iyz='0' izz='1'/>")), "link a",
                 "not positive definite");
  expect_refused(with(inertial("1", "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='3'/>")), "link a",
                 "triangle inequality");
  expect_refused(with(inertial("0", "<inertia ixx='-1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>")), "link a",
                 "not positive definite");
  expect_refused(with(""), "link a", "no inertial: it moves by joint j1");
  expect_refused(with(inertial("0", "<inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/>")), "link a",
                 "no inertial");
  expect_refused(arm(joint("f", "fixed", "a", "b") +
                     link("b", inertial("1", "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='3'/>"))),
                 "link b", "triangle inequality");
}

TEST(Urdf, MasslessLinksOfEachSort) {
  const scene::Robot r = load(arm(joint("f", "fixed", "a", "b") + link("b", inertial("0"))));
  EXPECT_TRUE(warned(r, "link b: mass 0 with an inertia"));
  EXPECT_LT((r.chain.link(0).inertia.about_com_kgm2 - 2 * Eigen::Matrix3d::Identity()).norm(), 1e-15);
  const scene::Robot behind = load(arm(joint("f", "fixed", "a", "b") + link("b"), ""));
  EXPECT_EQ(behind.chain.link(0).inertia.mass_kg, 1) << "what is fixed to a moving link gives it its mass";
}

TEST(Urdf, WhatIsNoOpenChainIsRefused) {
  expect_refused(
      arm(joint("j2", "continuous", "a", "b") + link("b") + joint("j3", "continuous", "a", "c") + link("c")),
      "link a", "several moving branches (joints j2, j3): a tree");
  expect_refused(arm(joint("j2", "continuous", "base", "a")), "link a",
                 "two parents (joints j1, j2): a loop");
  expect_refused(arm(joint("j2", "continuous", "a", "base")), "robot", "no root link");
  expect_refused(arm(link("alone")), "robot", "several root links");
  expect_refused(
      arm(joint("j2", "continuous", "b", "c") + joint("j3", "continuous", "c", "b") + link("b") + link("c")),
      "link b", "not connected");
  expect_refused(arm(joint("j2", "continuous", "a", "ghost")), "joint j2", "link ghost does not exist");
  expect_refused(arm("<joint name='j2' type='continuous'><parent link='a'/></joint>"), "joint j2",
                 "has no child link");
  expect_refused(arm(link("a")), "link a", "is there twice");
  expect_refused(arm(joint("j1", "continuous", "a", "b") + link("b")), "joint j1", "is there twice");
  expect_refused(robot(link("base")), "robot", "no moving joint");
  expect_refused(robot(""), "robot", "has no link");
}

TEST(Urdf, BadShapesAreRefusedByLink) {
  const auto with = [](const std::string& geometry) {
    return arm("", inertial("1") + "<collision>" + geometry + "</collision>");
  };
  expect_refused(with(""), "link a", "collision has no geometry");
  expect_refused(with("<geometry/>"), "link a", "collision has no geometry");
  expect_refused(with("<geometry><sphere/></geometry>"), "link a", "sphere has no radius");
  expect_refused(with("<geometry><sphere radius='-1'/></geometry>"), "link a", "must be >= 0");
  expect_refused(with("<geometry><cylinder radius='1'/></geometry>"), "link a", "cylinder has no length");
  expect_refused(with("<geometry><box size='1 0 1'/></geometry>"), "link a", "edge that is not > 0");
  expect_refused(with("<geometry><cone radius='1'/></geometry>"), "link a", "cone is not supported");
}

TEST(Urdf, WhatIsNoUrdfIsRefusedQuietly) {
  for (const char* text : {"", "hello", "<robot", "<a/>", "<robot name='r'><link/></robot>", "<robot/>"})
    expect_refused(text, "r.urdf", "");
  expect_refused("<robot name='r'>\n<link name='a'>\n</robot>", "r.urdf:", "not well-formed");
}

TEST(Urdf, AllProblemsOfAFileAreListed) {
  const auto r = parse_urdf(arm(joint("odd", "floating", "a", "b") + link("b", inertial("-1")) +
                                    joint("j3", "revolute", "b", "c", "<axis xyz='0 0 3'/>") + link("c", ""),
                                inertial("1", "<inertia ixx='1' ixy='2' ixz='0' iyy='1' iyz='0' izz='1'/>")),
                            "r.urdf");
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().size(),
            6u);  // a's inertia, odd's type, b's mass, j3's axis, j3's limit, c without inertial
}

TEST(Urdf, OddThingsAreWarnedOf) {
  const auto with = [](const std::string& inside) {
    return load(arm(joint("j2", "revolute", "a", "b", inside) + link("b")));
  };
  EXPECT_TRUE(warned(with("<axis xyz='0 0 1'/><limit lower='0' upper='0' effort='0' velocity='0'/>"),
                     "all limits are 0"));
  EXPECT_TRUE(warned(with("<limit lower='0' upper='1' effort='1' velocity='1'/>"), "no axis: x is taken"));
  EXPECT_TRUE(warned(
      with("<axis xyz='0 0 1'/><limit lower='0' upper='1' effort='1' velocity='1'/><dynamics friction='1'/>"),
      "dry friction 1 is not modelled"));
}

TEST(Urdf, ShippedRobotsLoadWithoutWarnings) {
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(HAMEL_SOURCE_DIR) + "/deploy/robots")) {
    const auto r = load_urdf(entry.path().string());
    ASSERT_TRUE(r) << to_string(r.error().front());
    EXPECT_TRUE(r.value().warnings.empty()) << r.value().warnings.front();
  }
}

}  // namespace
}  // namespace hamel::files
