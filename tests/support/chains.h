#pragma once
/// Chains for tests: the examples, and random ones from literal seeds.

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "common/lie/se3.h"
#include "common/model/chain.h"

namespace hamel::test {

/// A source of random numbers that is the same on every machine (the standard's distributions are not).
class Random {
 public:
  explicit Random(unsigned seed) : rng_(seed) {}
  double uniform(double a, double b) { return a + (b - a) * (static_cast<double>(rng_() >> 11) * 0x1p-53); }
  bool coin(double probability) { return uniform(0, 1) < probability; }
  Eigen::Vector3d vec3(double s) { return {uniform(-s, s), uniform(-s, s), uniform(-s, s)}; }
  Eigen::Vector3d unit() {
    Eigen::Vector3d v = vec3(1);
    while (v.norm() < 0.1) v = vec3(1);
    return v.normalized();
  }
  Eigen::VectorXd vector(int n, double s) {
    Eigen::VectorXd v(n);
    for (int i = 0; i < n; ++i) v[i] = uniform(-s, s);
    return v;
  }
  lie::Pose pose(double reach) { return {lie::exp_so3(uniform(0, 3.1) * unit()), vec3(reach)}; }

 private:
  std::mt19937_64 rng_;
};

/// A property test: `rng` is seeded by the test's parameter, which stands in the failing test's name.
class ForSeed : public testing::TestWithParam<unsigned> {
 protected:
  Random rng{GetParam()};
};

inline model::Chain checked(model::ChainSpec spec) {
  auto chain = model::build(std::move(spec));
  if (!chain) {
    for (const Problem& p : chain.error()) ADD_FAILURE() << to_string(p);
  }
  return chain.value();
}

/// A planar arm along +x that turns about +z, gravity along -y; links of one mass, length and inertia about
/// their middle [kg, m, kg m^2].
inline model::ChainSpec planar(int n, double mass_kg, double length_m, double inertia_kgm2) {
  model::ChainSpec spec;
  spec.name = "planar";
  spec.gravity_W_mps2 = {0, -9.81, 0};
  for (int i = 0; i < n; ++i) {
    model::Joint joint;
    joint.name = std::string("j").append(std::to_string(i + 1));
    if (i > 0) joint.X_PJ.p = {length_m, 0, 0};
    model::Link link;
    link.name = std::string("l").append(std::to_string(i + 1));
    link.inertia.mass_kg = mass_kg;
    link.inertia.com_m = {0.5 * length_m, 0, 0};
    link.inertia.about_com_kgm2 = inertia_kgm2 * Eigen::Matrix3d::Identity();
    spec.joints.push_back(joint);
    spec.links.push_back(link);
  }
  spec.X_NE.p = {length_m, 0, 0};
  return spec;
}

/// Example 5.1 of the paper: three links of 1 kg, 0.1 m, 1 kg m^2.
inline model::Chain paper_5_1() { return checked(planar(3, 1, 0.1, 1)); }
/// Example 5.2 of the paper: four unit links, no gravity.
inline model::Chain paper_5_2() {
  model::ChainSpec spec = planar(4, 1, 1, 1.0 / 12);
  spec.gravity_W_mps2.setZero();
  return checked(spec);
}
/// Three slender rods of 1 m and 1 kg falling from horizontal: fast and chaotic.
inline model::Chain fast_rods() { return checked(planar(3, 1, 1, 1.0 / 12)); }

/// A spatial arm that hangs and swings: 3 m long, or links of 0.1 m where that is longer.
inline model::ChainSpec hanging(int n) {
  const double length_m = std::max(3.0 / n, 0.1);
  model::ChainSpec spec;
  spec.name = "arm";
  spec.gravity_W_mps2 = {9.81, 0, 0};
  for (int i = 0; i < n; ++i) {
    model::Joint joint;
    joint.X_PJ.p = {i > 0 ? length_m : 0.0, 0, 0};
    joint.axis = i % 3 == 0   ? Eigen::Vector3d::UnitZ()
                 : i % 3 == 1 ? Eigen::Vector3d::UnitY()
                              : Eigen::Vector3d(0.6, 0, 0.8);
    model::Link link;
    link.inertia.mass_kg = 3 * length_m;
    link.inertia.com_m = {0.5 * length_m, 0.01, 0};
    const double across = link.inertia.mass_kg * (0.05 * 0.05 + length_m * length_m / 12);
    link.inertia.about_com_kgm2 = Eigen::Vector3d(link.inertia.mass_kg * 0.003, across, across).asDiagonal();
    spec.joints.push_back(joint);
    spec.links.push_back(link);
  }
  return spec;
}

struct RandomChain {
  double prismatic = 0.2;  ///< share of prismatic joints
  double armature = 0.3;   ///< share of joints with armature
  double damping = 0;      ///< share of joints with damping
  bool gravity = true;
  double mass_spread = 1;  ///< masses within 10^-+ this
};
/// A spatial chain with nothing aligned to anything.
inline model::ChainSpec random_spec(Random& rng, int n, const RandomChain& how = {}) {
  model::ChainSpec spec;
  spec.name = "random";
  spec.X_WB0 = rng.pose(1);
  spec.X_NE = rng.pose(0.3);
  spec.gravity_W_mps2 = how.gravity ? Eigen::Vector3d(9.81 * rng.unit()) : Eigen::Vector3d::Zero();
  for (int i = 0; i < n; ++i) {
    model::Joint joint;
    joint.X_PJ = rng.pose(0.5);
    joint.axis = rng.unit();
    if (rng.coin(how.prismatic)) joint.kind = model::JointKind::prismatic;
    if (rng.coin(how.armature)) joint.armature = rng.uniform(0, 0.1);
    if (rng.coin(how.damping)) joint.damping = rng.uniform(0, 1);
    model::Link link;
    model::Inertia& body = link.inertia;
    body.mass_kg = std::pow(10, rng.uniform(-how.mass_spread, how.mass_spread));
    body.com_m = rng.vec3(0.3);
    // moments of a box with these half edges: always a possible body
    const Eigen::Array3d s =
        Eigen::Array3d(rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4)).square();
    const Eigen::Vector3d moments(s[1] + s[2], s[0] + s[2], s[0] + s[1]);
    const Eigen::Matrix3d R = lie::exp_so3(rng.uniform(0, 3) * rng.unit());
    body.about_com_kgm2 = body.mass_kg / 3 * R * moments.asDiagonal() * R.transpose();
    body.about_com_kgm2 = (0.5 * (body.about_com_kgm2 + body.about_com_kgm2.transpose())).eval();
    spec.joints.push_back(joint);
    spec.links.push_back(link);
  }
  return spec;
}
inline model::Chain random_chain(Random& rng, int n, const RandomChain& how = {}) {
  return checked(random_spec(rng, n, how));
}

/// A random chain that moves in one plane somewhere in space: axes either way round, links off the plane.
inline model::ChainSpec random_planar_spec(Random& rng, int n, const RandomChain& how = {}) {
  model::ChainSpec spec = random_spec(rng, n, how);
  const auto turn_z = [](double angle) { return lie::exp_so3(Eigen::Vector3d(0, 0, angle)); };
  for (int i = 0; i < n; ++i) {
    model::Joint& joint = spec.joints[static_cast<std::size_t>(i)];
    joint.X_PJ.R = turn_z(rng.uniform(-3, 3));
    if (i == 0) joint.kind = model::JointKind::revolute;
    const bool slides = joint.kind == model::JointKind::prismatic;
    joint.axis = slides ? Eigen::Vector3d(turn_z(rng.uniform(-3, 3)).col(0))
                        : Eigen::Vector3d(0, 0, rng.coin(0.3) ? -1 : 1);
  }
  return spec;
}

}  // namespace hamel::test
