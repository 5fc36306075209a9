#include "common/model/chain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/support/chains.h"

namespace hamel::model {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(Chain, KeepsAxesAsUnitTwists) {
  ChainSpec spec = test::planar(2, 1, 1, 0.1);
  spec.joints[1].kind = JointKind::prismatic;
  spec.joints[1].axis = Eigen::Vector3d::UnitX();
  const Chain chain = test::checked(spec);
  EXPECT_EQ(chain.A_B(0), (lie::Twist() << 0, 0, 1, 0, 0, 0).finished());
  EXPECT_EQ(chain.A_B(1), (lie::Twist() << 0, 0, 0, 1, 0, 0).finished());
}

/// One way to spoil a good chain, and a word the refusal must contain.
struct Spoiled {
  const char* name;
  std::function<void(ChainSpec&)> spoil;
  const char* word;
};
class Refuses : public testing::TestWithParam<Spoiled> {};

TEST_P(Refuses, AndSaysWhy) {
  ChainSpec spec = test::planar(3, 1, 1, 0.1);
  GetParam().spoil(spec);
  const auto chain = build(spec);
  ASSERT_FALSE(chain);
  std::string all;
  for (const Problem& p : chain.error()) all += to_string(p) + "\n";
  EXPECT_NE(all.find(GetParam().word), std::string::npos) << all;
}

INSTANTIATE_TEST_SUITE_P(
    Chain, Refuses,
    testing::Values(
        Spoiled{"sizes", [](ChainSpec& s) { s.links.pop_back(); }, "2 for 3 joints"},
        Spoiled{"empty", [](ChainSpec& s) { s.links.clear(), s.joints.clear(); }, "at least one"},
        Spoiled{"axis", [](ChainSpec& s) { s.joints[1].axis *= 1.1; }, "joint j2.axis: has length 1.1"},
        Spoiled{"axis_nan", [](ChainSpec& s) { s.joints[1].axis[0] = kNaN; }, "not finite"},
        Spoiled{"rotation", [](ChainSpec& s) { s.joints[0].X_PJ.R(0, 0) = 1.01; }, "not orthonormal"},
        Spoiled{"mirror", [](ChainSpec& s) { s.joints[0].X_PJ.R(0, 0) = -1; }, "determinant -1"},
        Spoiled{"base", [](ChainSpec& s) { s.X_WB0.p[0] = INFINITY; }, "X_WB0"},
        Spoiled{"tip", [](ChainSpec& s) { s.X_NE.R *= 2; }, "X_NE"},
        Spoiled{"gravity", [](ChainSpec& s) { s.gravity_W_mps2[2] = kNaN; }, "gravity"},
        Spoiled{"mass", [](ChainSpec& s) { s.links[2].inertia.mass_kg = -1; }, "mass_kg: = -1"},
        Spoiled{"mass_nan", [](ChainSpec& s) { s.links[2].inertia.mass_kg = kNaN; }, "mass_kg: = nan"},
        Spoiled{"inertia_zero", [](ChainSpec& s) { s.links[2].inertia.about_com_kgm2.setZero(); },
                "positive definite"},
        Spoiled{"inertia_negative", [](ChainSpec& s) { s.links[2].inertia.about_com_kgm2(1, 1) = -1; },
                "positive definite"},
        Spoiled{"triangle", [](ChainSpec& s) { s.links[2].inertia.about_com_kgm2(1, 1) = 1; }, "triangle"},
        Spoiled{"asymmetric", [](ChainSpec& s) { s.links[2].inertia.about_com_kgm2(0, 1) = 0.01; },
                "symmetric"},
        Spoiled{"none", [](ChainSpec& s) { s.links[1].inertia = {}; }, "needs mass and inertia"},
        Spoiled{"limits", [](ChainSpec& s) { s.joints[0].limits.lower = 1, s.joints[0].limits.upper = 0; },
                "lower 1"},
        Spoiled{"effort", [](ChainSpec& s) { s.joints[0].limits.effort = 0; }, "effort: = 0"},
        Spoiled{"damping", [](ChainSpec& s) { s.joints[0].damping = -1; }, "damping: = -1"},
        Spoiled{"armature", [](ChainSpec& s) { s.joints[0].armature = kNaN; }, "armature: = nan"}),
    [](const auto& row) { return row.param.name; });

TEST(Chain, SlidesKeepToTheFartherOfTheirLimits) {
  ChainSpec spec = test::planar(3, 1, 1, 0.1);
  spec.joints[0].limits = {-1, 2};
  spec.joints[1].kind = spec.joints[2].kind = JointKind::prismatic;
  spec.joints[1].limits = {-0.5, 0.25};
  const Chain chain = test::checked(spec);
  EXPECT_EQ(travel_m(chain.joint(0)), 0) << "it turns";
  EXPECT_EQ(travel_m(chain.joint(1)), 0.5);
  EXPECT_EQ(travel_m(chain.joint(2)), INFINITY);
  EXPECT_TRUE(slides_hold(chain, Eigen::Vector3d(9, -0.5, 9)));
  EXPECT_TRUE(slides_hold(chain, Eigen::Vector3d(9, 0.5, 9)));
  EXPECT_FALSE(slides_hold(chain, Eigen::Vector3d(0, -0.51, 0)));
  EXPECT_FALSE(slides_hold(chain, Eigen::Vector3d(0, kNaN, 0)));
}

TEST(Chain, ListsEveryProblemAtOnce) {
  ChainSpec spec = test::planar(3, 1, 1, 0.1);
  spec.joints[0].damping = -1;
  spec.joints[1].axis.setZero();
  spec.links[2].inertia.mass_kg = -1;
  const auto chain = build(spec);
  ASSERT_FALSE(chain);
  EXPECT_EQ(chain.error().size(), 3u);
}

TEST(Chain, TakesFlatAndExtremeBodies) {
  ChainSpec spec = test::planar(3, 1, 1, 0.1);
  spec.links[0].inertia.about_com_kgm2.diagonal() = Eigen::Vector3d(1, 1, 2);  // a disc: equality
  spec.links[1].inertia.about_com_kgm2 *= 1e-8;
  spec.links[2].inertia.mass_kg = 1e6;
  EXPECT_TRUE(build(spec));
}

}  // namespace
}  // namespace hamel::model
