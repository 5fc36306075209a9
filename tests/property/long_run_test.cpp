// Many steps: energy has no trend, rotations stay rotations.  Short here, 1e6 and 1e7 steps with
// HAMEL_SOAK=1.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"
#include "tests/support/chains.h"
#include "tests/support/soak.h"

namespace hamel::dynamics {
namespace {

using Eigen::VectorXd;

/// A least-squares line through (k, y_k), and how far y ranges.
class Trend {
 public:
  void add(double y) {
    const double k = count_++;
    sum_k_ += k, sum_y_ += y, sum_kk_ += k * k, sum_ky_ += k * y;
    low_ = std::min(low_, y), high_ = std::max(high_, y);
  }
  double slope() const { return (count_ * sum_ky_ - sum_k_ * sum_y_) / (count_ * sum_kk_ - sum_k_ * sum_k_); }
  double amplitude() const { return high_ - low_; }
  /// The line's rise over the whole run, of the amplitude.
  double rise() const { return std::abs(slope()) * count_ / amplitude(); }

 private:
  double count_ = 0, sum_k_ = 0, sum_y_ = 0, sum_kk_ = 0, sum_ky_ = 0, low_ = INFINITY, high_ = -INFINITY;
};

Trend energy_trend(const model::Chain& chain, const Options& options, int steps) {
  const VectorXd zero = VectorXd::Zero(chain.n());
  Integrator integrator(chain, options);
  State s = integrator.start(zero, zero);
  const double E0 = integrator.energy(s), scale = rbd::energy_scale(chain);
  Trend trend;
  for (int k = 0; k < steps; ++k) {
    if (!integrator.step(s, zero).usable()) {
      ADD_FAILURE() << "step " << k;
      break;
    }
    trend.add((integrator.energy(s) - E0) / scale);
  }
  return trend;
}

/// Example 5.1 with its second and third axes out of the plane.
model::Chain spatial_5_1() {
  model::ChainSpec spec = test::planar(3, 1, 0.1, 1);
  spec.joints[1].axis = Eigen::Vector3d::UnitY();
  spec.joints[2].axis = Eigen::Vector3d(0.6, 0, 0.8);
  return test::checked(spec);
}

TEST(LongRun, EnergyHasNoTrend) {
  struct Case {
    model::Chain chain;
    Options options;
    double amplitude;  ///< of the energy scale, at most
  };
  const Case cases[] = {{test::paper_5_1(), {.dt_s = 0.02}, 6e-5},
                        {test::paper_5_1(), {.tier = Tier::gauss, .dt_s = 0.16, .stages = 2}, 6e-6},
                        {test::paper_5_1(), {.tier = Tier::gauss, .dt_s = 0.4, .stages = 4}, 4e-7},
                        {test::paper_5_1(), {.tier = Tier::gauss, .dt_s = 1, .stages = 8}, 2e-8},
                        {spatial_5_1(), {.dt_s = 0.02}, 1e-4},
                        {spatial_5_1(), {.tier = Tier::gauss, .dt_s = 0.16, .stages = 2}, 2e-5}};
  for (const Case& c : cases) {
    const bool cheap = c.options.tier == Tier::midpoint;
    const Trend trend = energy_trend(c.chain, c.options, test::soak() ? 1000000 : cheap ? 100000 : 25000);
    EXPECT_LE(trend.rise(), 0.1) << "stages " << c.options.stages << " dt " << c.options.dt_s;
    EXPECT_LT(trend.amplitude(), c.amplitude) << "stages " << c.options.stages << " dt " << c.options.dt_s;
  }
}

// The guard bites: the paper's own tier loses energy steadily.
TEST(LongRun, TrendOfThePapersTierIsSeen) {
  EXPECT_GT(energy_trend(test::paper_5_1(), {.tier = Tier::hamel, .dt_s = 0.01}, 20000).rise(), 0.5);
}

double off_rotation(const rbd::Workspace& ws) {
  double worst = 0;
  for (const lie::Pose& X : ws.X_WB)
    worst = std::max(worst, (X.R.transpose() * X.R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff());
  return worst;
}

TEST(LongRun, RotationsStayRotationsWhileTheArmSpins) {
  const int steps = test::soak() ? 10000000 : 100000;
  test::Random rng(5);
  const model::Chain chain =
      test::random_chain(rng, 4, {.prismatic = 0, .gravity = false, .mass_spread = 0.3});
  Integrator integrator(chain, {.dt_s = 1e-3});
  State s = integrator.start(VectorXd::Zero(4), rng.vector(4, 5));
  const double E0 = integrator.energy(s), p0 = s.p[0];
  rbd::Workspace ws(chain);
  double worst = 0;
  for (int k = 0; k < steps; ++k) {
    ASSERT_TRUE(integrator.step(s, VectorXd::Zero(4)).usable()) << "step " << k;
    if (k % 1000 != 0) continue;
    rbd::positions(chain, s.q, ws);
    worst = std::max(worst, off_rotation(ws));
  }
  EXPECT_LT(worst, 16 * 2.3e-16) << "products of four rotations, whatever the angle";
  EXPECT_NEAR(integrator.energy(s), E0, 2e-2 * E0);
  EXPECT_NEAR(s.p[0], p0, 1e-9 * s.p.norm());
}

}  // namespace
}  // namespace hamel::dynamics
