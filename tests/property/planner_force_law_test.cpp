// The laws of force: closed forms of a free particle against a wall, and the power of the joint mappings.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/planner/core/force_law.h"
#include "services/planner/core/mapping.h"
#include "tests/support/chains.h"

namespace hamel::planner {
namespace {

using Eigen::Vector3d;
using scene::GainForm;

// A particle of 1 kg flying at the wall x = d0 in the x-y plane, turned by w x v alone; its least distance to
// the wall. The speed is kept, so only the heading is integrated: dphi/dt = k(phi, d), RK4.
double least_distance(const scene::PlannerOptions& o, GainForm form, double d0, double speed, double phi0) {
  const double dt = 1e-4;
  const Vector3d n = Vector3d::UnitX();
  double d = d0, phi = phi0, least = d0;
  const auto heading = [&](double a) { return Vector3d(speed * Vector3d(std::cos(a), std::sin(a), 0)); };
  const auto turn = [&](double distance, double a) {
    const Vector3d v = heading(a);
    if (form == GainForm::S)
      return gyro_gain(o, form, n, distance, v) * turning_axis(n, v, Vector3d::Zero())[2];
    return paper_rotation(o, n, distance, v)[2];
  };
  for (int k = 0; k < 400000 && std::cos(phi) > 0; ++k) {
    const double k1 = turn(d, phi), v1 = -speed * std::cos(phi);
    const double k2 = turn(d + dt / 2 * v1, phi + dt / 2 * k1), v2 = -speed * std::cos(phi + dt / 2 * k1);
    const double k3 = turn(d + dt / 2 * v2, phi + dt / 2 * k2), v3 = -speed * std::cos(phi + dt / 2 * k2);
    const double k4 = turn(d + dt * v3, phi + dt * k3), v4 = -speed * std::cos(phi + dt * k3);
    phi += dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    d += dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    least = std::min(least, d);
  }
  return least;
}

TEST(FreeParticle, SpeedScaledLawStopsAtTheClosedForm) {
  const double cases[][4] = {{0.5, 1, 0.1, 0.1149}, {0.5, 2, 0.1, 0.2397}, {0.5, 0.5, 0.5, 0.05873}};
  for (const auto& [d0, kobs, phi0, d_min] : cases) {
    for (const double speed : {0.3, 1.0, 3.0}) {  // scale-invariant in speed
      scene::PlannerOptions o;
      o.kobs = kobs;
      o.rho0_m = 1e12;  // both gates open
      o.c0 = 1e-9;
      EXPECT_NEAR(d0 * std::exp(-(M_PI / 2 - phi0) / kobs), d_min, 1e-4);
      EXPECT_NEAR(least_distance(o, GainForm::S, d0, speed, phi0) / d_min, 1, 0.01)
          << kobs << " at " << speed;
    }
  }
}

TEST(FreeParticle, PaperFormsStopAtTheClosedForm) {
  struct Case {
    GainForm form;
    double kobs, phi0, d_min;
  };
  for (const Case& c : {Case{GainForm::F1, 2, 0.1, 0.1012}, Case{GainForm::F1, 2, 0.01, 0.0160},
                        Case{GainForm::F3, 2, 0.1, 0.1432}, Case{GainForm::F3, 0.5, 0.1, 0.004845},
                        Case{GainForm::F2, 1, 0.1, 0.3510}}) {
    scene::PlannerOptions o;
    o.gain_form = c.form;
    o.kobs = c.kobs;
    o.rho0_m = 0.5;
    EXPECT_NEAR(least_distance(o, c.form, 0.5, 1, c.phi0) / c.d_min, 1, 0.01)
        << static_cast<int>(c.form) << " " << c.kobs;
  }
}

TEST(ForceLaw, PushesAwayAndIsGyroscopic) {
  test::Random rng(1);
  scene::PlannerOptions o;
  for (const GainForm form : {GainForm::F1, GainForm::F2, GainForm::F3, GainForm::S}) {
    o.gain_form = form;
    for (int k = 0; k < 10000; ++k) {
      const Vector3d n = rng.unit(), v = rng.vec3(2);
      const double d = rng.uniform(-0.1, 0.6);
      const Vector3d f = paper_rotation(o, n, d, v).cross(v);
      ASSERT_LE(std::abs(f.dot(v)), 1e-13 * f.norm() * v.norm());
      ASSERT_LE(f.dot(n), 1e-12 * f.norm());
      ASSERT_TRUE(f.isZero(0) || (d <= o.rho0_m && n.dot(v) > 0));
    }
  }
}

TEST(ForceLaw, HasNoNaNWhereTheAngleIsDegenerate) {
  scene::PlannerOptions o;
  test::Random rng(2);
  for (int k = 0; k < 10000; ++k) {
    const Vector3d n = rng.unit(), v = n * rng.uniform(-2, 2);
    for (const GainForm form : {GainForm::F1, GainForm::F2, GainForm::F3, GainForm::S}) {
      o.gain_form = form;
      ASSERT_TRUE(paper_rotation(o, n, 0.1, v).allFinite());
      ASSERT_TRUE(paper_rotation(o, n, 0, 0 * v).allFinite());
      ASSERT_TRUE(std::isfinite(gyro_gain(o, form, n, 0, v)));
    }
    ASSERT_TRUE(std::isfinite(approach_angle(n, v)));
  }
}

// What the reports call the gate is the part of the gain that distance and heading let through.
TEST(ForceLaw, GateIsTheGainOverWhatTheGainWouldBeWideOpen) {
  scene::PlannerOptions o;
  test::Random rng(3);
  for (int k = 0; k < 10000; ++k) {
    const Vector3d n = rng.unit(), v = rng.uniform(0.01, 2) * rng.unit();
    const double d = rng.uniform(0.001, 1.5 * o.rho0_m), closing = n.dot(v);
    for (const GainForm form : {GainForm::F1, GainForm::F2, GainForm::F3, GainForm::S}) {
      const double g = gyro_gate(o, form, n, d, v), phi = approach_angle(n, v);
      ASSERT_TRUE(g >= 0 && g <= 1);
      ASSERT_EQ(g == 0, d > o.rho0_m || closing <= 0) << d << " " << closing;
      const double open = form == GainForm::S    ? closing
                          : form == GainForm::F1 ? std::exp(phi) - 1
                          : form == GainForm::F2 ? std::exp(1 / std::max(phi, o.phi_min_rad))
                                                 : std::exp(phi - 1);
      ASSERT_NEAR(gyro_gain(o, form, n, d, v), g * o.kobs * open / d, 1e-12 * o.kobs * std::abs(open) / d);
    }
    o.method = scene::Method::attract;
    ASSERT_EQ(gate(o, n, d, v), 0);
    o.method = scene::Method::khatib;
    ASSERT_EQ(gate(o, n, d, v) * khatib_force(o, n, d), khatib_force(o, n, d));
    o.method = scene::Method::gyro;
    ASSERT_EQ(gate(o, n, d, v), gyro_gate(o, GainForm::S, n, d, v));
  }
}

// Straight at the centre the paper's axis is not defined and the particle flies into the wall; a preferred
// axis turns it to that side, always.
TEST(ForceLaw, PreferredAxisDecidesHeadOn) {
  scene::PlannerOptions o;
  const Vector3d n = Vector3d::UnitX();
  EXPECT_TRUE(paper_rotation(o, n, 0.1, n).isZero(0));
  EXPECT_EQ(turning_axis(n, n, Vector3d::UnitZ()), Vector3d::UnitZ());
  EXPECT_EQ(turning_axis(n, Vector3d::Zero(), Vector3d::UnitZ()), Vector3d::UnitZ());
  EXPECT_TRUE(turning_axis(n, n, Vector3d::Zero()).isZero(0));
  EXPECT_NEAR(turning_axis(n, Vector3d(1, 0.01, 0), -Vector3d::UnitZ())[2], -1, 1e-12);
  EXPECT_NEAR(turning_axis(n, Vector3d(1, 0.5, 0), -Vector3d::UnitZ())[2], 1, 1e-12);
}

struct PointOnArm {
  Eigen::VectorXd qd;
  Eigen::MatrixXd J;
  Eigen::Matrix3d Lam;
  Vector3d w;
};

PointOnArm random_point(test::Random& rng, const model::Chain& chain, rbd::Workspace& ws,
                        const scene::PlannerOptions& o) {
  PointOnArm p{rng.vector(7, 2), Eigen::MatrixXd(3, 7), {}, {}};
  rbd::velocities(chain, rng.vector(7, 3), p.qd, ws);
  rbd::point_jacobian(chain, ws, 6, ws.X_WB[6] * rng.vec3(0.3), p.J);
  Eigen::MatrixXd M(7, 7);
  rbd::mass_matrix(chain, ws, M);
  p.Lam = operational_inertia(o, p.J * M.llt().solve(p.J.transpose()));
  p.w = rng.vec3(5);
  return p;
}

TEST(Mapping, ForceAndSymmetricArePowerlessAndThePapersIsNot) {
  test::Random rng(3);
  scene::PlannerOptions o;
  double worst_paper = 0, sum_paper = 0;
  int count = 0;
  for (int c = 0; c < 20; ++c) {
    const model::Chain chain = test::random_chain(rng, 7, {.prismatic = 0});
    rbd::Workspace ws(chain);
    for (int k = 0; k < 5000; ++k, ++count) {
      const PointOnArm p = random_point(rng, chain, ws, o);
      for (const scene::Mapping mapping : {scene::Mapping::force, scene::Mapping::symmetric}) {
        Eigen::MatrixXd G = Eigen::MatrixXd::Zero(7, 7);
        add_gyroscopic(joint_rotation(mapping, p.Lam, p.w), p.J, G);
        ASSERT_EQ(G, -G.transpose());
        const Eigen::VectorXd tau = G * p.qd;
        ASSERT_LE(std::abs(tau.dot(p.qd)), 1e-12 * tau.norm() * p.qd.norm());
      }
      const Eigen::VectorXd tau =
          p.J.transpose() * (p.Lam * p.w.cross(Vector3d(p.J * p.qd)));  // Eq. (21) verbatim
      const double power = std::abs(tau.dot(p.qd)) / (tau.norm() * p.qd.norm());
      worst_paper = std::max(worst_paper, power);
      sum_paper += power;
    }
  }
  EXPECT_GT(sum_paper / count, 0.05);
  EXPECT_GT(worst_paper, 0.5);
  RecordProperty("paper_mean", std::to_string(sum_paper / count));
  RecordProperty("paper_max", std::to_string(worst_paper));
}

// J^T hat(w') J with hat(w') = (Lam hat(w) + hat(w) Lam)/2: Eq. (21) with its working part taken out.
TEST(Mapping, SymmetricIsTheSkewPartOfThePapers) {
  test::Random rng(4);
  scene::PlannerOptions o;
  const model::Chain chain = test::random_chain(rng, 7);
  rbd::Workspace ws(chain);
  for (int k = 0; k < 1000; ++k) {
    const PointOnArm p = random_point(rng, chain, ws, o);
    Eigen::Matrix3d hat;
    hat << 0, -p.w[2], p.w[1], p.w[2], 0, -p.w[0], -p.w[1], p.w[0], 0;
    const Eigen::MatrixXd paper = p.J.transpose() * p.Lam * hat * p.J;
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(7, 7);
    add_gyroscopic(joint_rotation(scene::Mapping::symmetric, p.Lam, p.w), p.J, G);
    ASSERT_LE((0.5 * (paper - paper.transpose()) - G).norm(), 1e-12 * paper.norm());
  }
}

}  // namespace
}  // namespace hamel::planner
