// A chain from the screws of a product of exponentials is the chain from frame to frame.
#include "common/model/screws.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/rbd/rbd.h"
#include "tests/support/chains.h"

namespace hamel::model {
namespace {

using Eigen::VectorXd;

/// The screws of a chain as it stands at zero; link frames moved away from the joints.
ScrewSpec screws_of(const Chain& chain, test::Random& rng) {
  ScrewSpec spec;
  spec.name = chain.name(), spec.X_WB0 = chain.X_WB0(), spec.gravity_W_mps2 = chain.gravity_W_mps2();
  lie::Pose X_B0B;
  for (int i = 0; i < chain.n(); ++i) {
    const Joint& joint = chain.joint(i);
    X_B0B = X_B0B * joint.X_PJ;
    Screw s;
    s.kind = joint.kind, s.damping = joint.damping, s.armature = joint.armature;
    s.S_B0 = lie::Ad(X_B0B, chain.A_B(i));
    const lie::Pose X_BL = rng.pose(0.5);
    s.X_B0L = X_B0B * X_BL;
    const Inertia& body = chain.link(i).inertia;
    s.inertia = {body.mass_kg, inverse(X_BL) * body.com_m, X_BL.R.transpose() * body.about_com_kgm2 * X_BL.R};
    spec.joints.push_back(s);
  }
  spec.X_B0E = X_B0B * chain.X_NE();
  return spec;
}

class Screws : public test::ForSeed {};
INSTANTIATE_TEST_SUITE_P(Unit, Screws, testing::Range(0u, 20u));

TEST_P(Screws, BuildTheSameArm) {
  const int n = 1 + static_cast<int>(GetParam() % 7);
  const Chain frames = test::random_chain(rng, n);
  const ScrewSpec spec = screws_of(frames, rng);
  const auto built = build(spec);
  ASSERT_TRUE(built) << to_string(built.error().front());
  const Chain& chain = built.value();
  const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2), tau = rng.vector(n, 3);
  lie::Pose X_B0E;  // exp(S_1 q_1) ... exp(S_n q_n) X_B0E(0)
  for (int i = 0; i < n; ++i)
    X_B0E = X_B0E * lie::exp_se3(spec.joints[static_cast<std::size_t>(i)].S_B0 * q[i]);
  const lie::Pose product = spec.X_WB0 * X_B0E * spec.X_B0E;
  rbd::Workspace ws(chain), other(frames);
  rbd::velocities(chain, q, qd, ws);
  rbd::velocities(frames, q, qd, other);
  EXPECT_LT((rbd::tip(chain, ws).p - product.p).norm() + (rbd::tip(chain, ws).R - product.R).norm(), 1e-12);
  const double T = rbd::kinetic_energy(frames, other, qd), U = rbd::potential_energy(frames, other);
  EXPECT_NEAR(rbd::kinetic_energy(chain, ws, qd), T, 1e-12 * T);
  EXPECT_NEAR(rbd::potential_energy(chain, ws), U, 1e-12 * (1 + std::abs(U)));
  VectorXd a(n), b(n);
  rbd::forward_dynamics(chain, q, qd, tau, ws, a);
  rbd::forward_dynamics(frames, q, qd, tau, other, b);
  EXPECT_LT((a - b).norm(), 1e-10 * (1 + b.norm()));
}

TEST(ScrewProblems, AreAllNamed) {
  test::Random rng(3);
  ScrewSpec spec = screws_of(test::random_chain(rng, 3, {.prismatic = 0}), rng);
  spec.joints[0].S_B0.tail<3>() += 0.1 * spec.joints[0].S_B0.head<3>();  // a pitch
  spec.joints[1].S_B0 *= 2;                                              // not unit
  spec.joints[2].kind = JointKind::prismatic;                            // but it turns
  const auto built = build(spec);
  ASSERT_FALSE(built);
  std::string all;
  for (const Problem& p : built.error()) all += to_string(p) + "\n";
  for (const char* word :
       {"joint 0.S_B0: has pitch", "joint 1.axis: has length", "joint 2.S_B0: of a prismatic"})
    EXPECT_NE(all.find(word), std::string::npos) << all;
  for (Screw& s : spec.joints) s.S_B0.setConstant(std::nan(""));
  EXPECT_FALSE(build(spec));
}

}  // namespace
}  // namespace hamel::model
