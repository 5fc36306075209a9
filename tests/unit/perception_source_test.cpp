// Where obstacles are at a time: scripted motions and streams sampled anew.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/lie/so3.h"
#include "services/perception/core/source.h"

namespace hamel::perception {
namespace {

using geometry::Obstacle;
constexpr double kInf = std::numeric_limits<double>::infinity();

scene::ScriptedObstacle sphere(std::uint32_t id, const Eigen::Vector3d& p) {
  scene::ScriptedObstacle o;
  o.at_start.id = id;
  o.at_start.shape.dims_m[0] = 0.1;
  o.at_start.X_WO.p = p;
  return o;
}

/// A sphere of a stream at one time.
struct Row {
  double t_s;
  std::uint32_t id;
  Eigen::Vector3d p_m;
  double radius_m;
};

scene::PerceptionOptions with_stream(const std::vector<Row>& rows) {
  scene::PerceptionOptions o;
  o.stream.emplace();
  for (const Row& r : rows)
    o.stream->samples.push_back({r.t_s, r.id, r.p_m, {geometry::ShapeKind::sphere, {r.radius_m, 0, 0}}});
  return o;
}

Source make(const scene::PerceptionOptions& o) {
  auto r = Source::make(o);
  if (!r) throw std::runtime_error(to_string(r.error().front()));
  return std::move(r).value();
}

std::vector<Obstacle> at(const Source& s, double t_s) {
  std::vector<Obstacle> out;
  EXPECT_TRUE(s.at(t_s, out)) << t_s;
  return out;
}

TEST(Source, RefusesOptionsThatBreakARule) {
  scene::PerceptionOptions o;
  o.rate_hz = -1;
  EXPECT_FALSE(Source::make(o));
}

TEST(Source, WithoutObstaclesIsAnEmptyStaticSet) {
  const Source s = make({});
  EXPECT_TRUE(s.is_static());
  EXPECT_TRUE(at(s, 0).empty());
  EXPECT_EQ(s.next_time(0), kInf);
}

TEST(Source, StandingObstaclesChangeNever) {
  scene::PerceptionOptions o;
  o.obstacles = {sphere(5, {1, 2, 3})};
  const Source s = make(o);
  EXPECT_TRUE(s.is_static());
  EXPECT_EQ(s.next_time(3), kInf);
  EXPECT_EQ(at(s, 1e6)[0].X_WO.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(at(s, 0)[0].velocity_known);
}

TEST(Source, LinearMotionIsExact) {
  scene::PerceptionOptions o;
  o.obstacles = {sphere(1, {1, 0, 0})};
  o.obstacles[0].velocity_mps = {0, 2, 0};
  const Source s = make(o);
  EXPECT_FALSE(s.is_static());
  EXPECT_EQ(at(s, 1.5)[0].X_WO.p, Eigen::Vector3d(1, 3, 0));
  EXPECT_EQ(at(s, 1.5)[0].V_WO.tail<3>(), Eigen::Vector3d(0, 2, 0));
  EXPECT_NEAR(s.next_time(0), 1.0 / 30, 1e-15);
}

TEST(Source, SinusoidsVelocityIsThatOfItsPosition) {
  scene::PerceptionOptions o;
  o.obstacles = {sphere(1, {0, 0, 1})};
  o.obstacles[0].amplitude_m = {0.3, 0, -0.1};
  o.obstacles[0].frequency_hz = 0.7;
  o.obstacles[0].phase_rad = 0.4;
  const Source s = make(o);
  for (const double t : {0.0, 0.31, 2.0}) {
    const double h = 1e-5;
    const Eigen::Vector3d v = (at(s, t + h)[0].X_WO.p - at(s, t - h)[0].X_WO.p) / (2 * h);
    EXPECT_LT((v - at(s, t)[0].V_WO.tail<3>()).norm(), 1e-8) << t;
  }
}

TEST(Source, GridVisitsEveryPeriodOnceForLongTimes) {
  scene::PerceptionOptions o;
  o.obstacles = {sphere(1, {0, 0, 0})};
  o.obstacles[0].velocity_mps = {1, 0, 0};
  const Source s = make(o);
  double t = 0;
  for (int k = 1; k <= 30000; ++k) {
    t = s.next_time(t);
    ASSERT_DOUBLE_EQ(t, k / 30.0);
  }
}

TEST(Source, StreamIsInterpolatedWithTheVelocityOfTheLine) {
  auto o = with_stream({{0, 1, {0, 0, 0}, 0.1}, {0.4, 1, {0.4, 0, 0}, 0.2}});
  o.stream->X_WS.p = {0, 0, 5};
  o.stream->X_WS.R << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // x of the stream is y of the world
  o.stream->scale = 2;
  o.stream->rate = 0.5;
  const Source s = make(o);
  const Obstacle x = at(s, 0.4).at(0);  // 0.2 s of the stream
  EXPECT_LT((x.X_WO.p - Eigen::Vector3d(0, 0.4, 5)).norm(), 1e-15);
  EXPECT_LT((x.V_WO.tail<3>() - Eigen::Vector3d(0, 1, 0)).norm(), 1e-15);
  EXPECT_NEAR(x.shape.dims_m[0], 0.3, 1e-15);
  EXPECT_TRUE(x.velocity_known);
}

TEST(Source, StreamIsSampledAtLeastThirtyTimesASecond) {
  auto o = with_stream({{0, 1, {0, 0, 0}, 0.1}, {0.4, 1, {1, 0, 0}, 0.1}});
  o.rate_hz = 5;
  EXPECT_NEAR(make(o).period_s(), 1.0 / 30, 1e-15);
  o.rate_hz = 100;
  EXPECT_NEAR(make(o).period_s(), 0.01, 1e-15);
}

TEST(Source, IdsComeAndGo) {
  const Source s = make(with_stream({{0, 1, {0, 0, 0}, 1},
                                     {0, 2, {5, 0, 0}, 1},
                                     {0.1, 1, {1, 0, 0}, 1},
                                     {0.2, 1, {2, 0, 0}, 1},
                                     {0.2, 3, {9, 0, 0}, 1}}));
  EXPECT_EQ(at(s, 0.05).size(), 2u);
  const Obstacle lonely = at(s, 0.05)[1];  // seen once: stands, with unknown velocity
  EXPECT_EQ(lonely.id, 2u);
  EXPECT_FALSE(lonely.velocity_known);
  EXPECT_EQ(lonely.X_WO.p.x(), 5);
  EXPECT_EQ(at(s, 0.1).size(), 1u);
  EXPECT_EQ(at(s, 0.2).size(), 2u);
  EXPECT_NEAR(at(s, 0.25)[0].X_WO.p.x(), 2.5, 1e-12);  // goes on with its last velocity
  EXPECT_TRUE(at(s, 0.31).empty());                    // and is over one interval later
}

TEST(Source, EndIsOneEmptySetAndThenNothing) {
  const Source s = make(with_stream({{0, 1, {0, 0, 0}, 1}, {0.1, 1, {1, 0, 0}, 1}}));
  double t = 0, last = 0;
  int sets = 1;
  for (; (t = s.next_time(t)) < kInf; ++sets) last = t;
  EXPECT_EQ(sets, 7);  // 0, 1/30 .. 6/30 = end
  EXPECT_TRUE(at(s, last).empty());
}

TEST(Source, LoopRepeatsItself) {
  auto o = with_stream({{2, 1, {0, 0, 0}, 1}, {2.1, 1, {1, 0, 0}, 1}, {2.2, 1, {0, 0, 0}, 1}});
  o.stream->start_s = 2;
  o.stream->loop = true;
  const Source s = make(o);
  for (const double t : {0.0, 0.03, 0.17, 0.29}) {
    EXPECT_NEAR(at(s, t)[0].X_WO.p.x(), at(s, t + 0.3)[0].X_WO.p.x(), 1e-12) << t;
    EXPECT_NEAR(at(s, t)[0].X_WO.p.x(), at(s, t + 3000)[0].X_WO.p.x(), 1e-7) << t;
  }
  EXPECT_LT(s.next_time(1e5), 1e5 + 0.04);
}

TEST(Source, GapIsSilenceNotAnEmptySet) {
  const Source s = make(with_stream(
      {{0, 1, {0, 0, 0}, 1}, {0.1, 1, {1, 0, 0}, 1}, {2.05, 1, {2, 0, 0}, 1}, {2.1, 1, {3, 0, 0}, 1}}));
  std::vector<Obstacle> out(3);
  EXPECT_TRUE(s.at(0.1, out));
  EXPECT_FALSE(s.at(0.5, out));
  EXPECT_TRUE(out.empty());
  EXPECT_FALSE(s.at(2.04, out));
  EXPECT_TRUE(s.at(2.05, out));
  const double next = s.next_time(0.1);
  EXPECT_GE(next, 2.05);
  EXPECT_LT(next, 2.05 + 1.0 / 30 + 1e-12);
  EXPECT_EQ(at(s, next).size(), 1u);
}

TEST(Source, GapThatEndsJustBehindAGridPointIsLeft) {
  const Source s =
      make(with_stream({{0, 1, {0, 0, 0}, 1}, {2 + 1e-9, 1, {2, 0, 0}, 1}, {2.1, 1, {3, 0, 0}, 1}}));
  EXPECT_GE(s.next_time(0), 2 + 1e-9);
  EXPECT_LT(s.next_time(0), 2.07);
}

TEST(Source, BeforeItsFirstSampleThereIsNothing) {
  auto o = with_stream({{5, 1, {0, 0, 0}, 1}, {5.1, 1, {1, 0, 0}, 1}});
  o.stream->start_s = 4;
  const Source s = make(o);
  EXPECT_TRUE(at(s, 0.5).empty());
  EXPECT_EQ(at(s, 1.0).size(), 1u);
}

TEST(Source, ScriptedComeFirstAndRoomForAllIsKnown) {
  auto o = with_stream({{0, 9, {0, 0, 0}, 1}, {0, 4, {0, 0, 0}, 1}, {0.1, 4, {0, 0, 0}, 1}});
  o.obstacles = {sphere(20, {0, 0, 0})};
  const Source s = make(o);
  const auto all = at(s, 0);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].id, 20u);
  EXPECT_EQ(all[1].id, 4u);
  EXPECT_EQ(all[2].id, 9u);
  EXPECT_EQ(s.most_obstacles(), 3u);
}

TEST(Source, SameTimeSameBitsInAnyOrder) {
  auto o = with_stream({{0, 1, {0, 0.1, 0}, 1}, {0.033, 1, {0.7, 0, 0}, 1}, {0.066, 1, {1, 0.3, 0}, 1}});
  o.stream->loop = true;
  const Source s = make(o);
  std::vector<Eigen::Vector3d> forth;
  for (int k = 0; k < 100; ++k) forth.push_back(at(s, 0.0123 * k)[0].X_WO.p);
  for (int k = 99; k >= 0; --k) EXPECT_EQ(at(s, 0.0123 * k)[0].X_WO.p, forth[static_cast<std::size_t>(k)]);
}

TEST(Source, AGlitchOfThirtyMetresASecondIsPassedOverAndCounted) {
  std::vector<Row> samples;
  for (int i = 0; i < 10; ++i) samples.push_back({i * 0.1, 1, {0.1 * i, 0, 0}, 0.1});  // 1 m/s along x
  samples[5].p_m.y() = 3;                                                              // and back: 30 m/s
  const Source s = make(with_stream(samples));
  for (int k = 0; k < 29; ++k) {
    const auto o = at(s, k / 30.0);
    ASSERT_EQ(o.size(), 1u);
    EXPECT_TRUE(o[0].velocity_known) << k;
    EXPECT_LT((o[0].V_WO.tail<3>() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9) << k;
    EXPECT_LT((o[0].X_WO.p - Eigen::Vector3d(k / 30.0, 0, 0)).norm(), 1e-9) << k;
    EXPECT_EQ(s.glitches(k / 30.0), k >= 15) << k;
  }
  auto all = with_stream(samples);
  all.stream->glitch_mps = 100;
  EXPECT_GT(at(make(all), 0.45)[0].V_WO.norm(), 29) << "the guard can be turned off";
}

TEST(Source, ACausalStreamKnowsNothingOfTheNextSample) {
  std::vector<Row> samples;
  for (int i = 0; i < 4; ++i) samples.push_back({i * 0.4, 1, {0.4 * i, 0, 0}, 0.1});
  samples[3].p_m.y() = 0.4;  // turns
  auto options = with_stream(samples);
  options.stream->causal = true;
  const Source s = make(options);
  EXPECT_FALSE(at(s, 0.2)[0].velocity_known);
  EXPECT_EQ(at(s, 0.2)[0].X_WO.p, Eigen::Vector3d::Zero());
  const Obstacle before = at(s, 1.1)[0], behind = at(s, 1.3)[0];
  EXPECT_LT((before.X_WO.p - Eigen::Vector3d(1.1, 0, 0)).norm(), 1e-12) << "goes on from the last two";
  EXPECT_LT((before.V_WO.tail<3>() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((behind.X_WO.p - Eigen::Vector3d(1.3, 0.5, 0)).norm(), 1e-12);
}

TEST(Source, ASolidOfAStreamTurnsAndGrowsOnItsLine) {
  auto o = with_stream({});
  const auto box = [](double t_s, double angle, double edge) {
    scene::StreamSample s{t_s, 4, {t_s, 0, 0}, {geometry::ShapeKind::box, {edge, 1, 1}}};
    s.R_SO = lie::exp_so3(Eigen::Vector3d(0, 0, angle));
    return s;
  };
  o.stream->samples = {box(0, 0.3, 1), box(0.4, 0.7, 2), box(0.8, 1.1, 2)};
  o.stream->scale = 2;
  o.stream->rate = 0.5;
  o.stream->X_WS.R = lie::exp_so3(Eigen::Vector3d(0.5, 0, 0));
  const Obstacle x = at(make(o), 0.4).at(0);  // 0.2 s of the stream
  EXPECT_EQ(x.shape.kind, geometry::ShapeKind::box);
  EXPECT_LT((x.shape.dims_m - Eigen::Vector3d(3, 2, 2)).norm(), 1e-14);
  EXPECT_LT((x.X_WO.R - o.stream->X_WS.R * lie::exp_so3(Eigen::Vector3d(0, 0, 0.5))).norm(), 1e-14);
  EXPECT_LT((x.V_WO.head<3>() - o.stream->X_WS.R * Eigen::Vector3d(0, 0, 0.5)).norm(), 1e-14);
  EXPECT_LT((x.V_WO.tail<3>() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-14);
}

TEST(Source, NothingThereIsAnEmptySetNotAGap) {
  auto o = with_stream({{0, 1, {0, 0, 0}, 1}, {0.1, 1, {1, 0, 0}, 1}, {2, 1, {2, 0, 0}, 1}});
  o.stream->empty_s = {0.2, 1.0, 1.9};
  const Source s = make(o);
  EXPECT_EQ(at(s, 0.19).size(), 1u);
  for (const double t : {0.2, 0.5, 1.0, 1.5, 1.95}) EXPECT_TRUE(at(s, t).empty()) << t;
  EXPECT_EQ(at(s, 2.0).size(), 1u);
}

TEST(Source, UntilIsTheLastSampleThatCounts) {
  auto o = with_stream({{0, 1, {0, 0, 0}, 1}, {0.1, 1, {1, 0, 0}, 1}, {0.2, 1, {2, 0, 0}, 1}});
  o.stream->until_s = 0.1;
  const Source s = make(o);
  EXPECT_EQ(at(s, 0.15).size(), 1u);
  EXPECT_TRUE(at(s, 0.21).empty());
  o.stream->until_s = -1;
  EXPECT_FALSE(Source::make(o)) << "nothing is left";
}

scene::PerceptionOptions flawed(const scene::Flaws& f) {
  scene::PerceptionOptions o;
  for (std::uint32_t id = 1; id <= 200; ++id) o.obstacles.push_back(sphere(id, {1.0 * id, 0, 0}));
  o.flaws = f;
  return o;
}

TEST(Flaws, AreTheSameForTheSameSeedAndOtherwiseForAnother) {
  const scene::Flaws f{.seed = 7, .noise_m = 0.01, .dropout = 0.2};
  const Source a = make(flawed(f)), b = make(flawed(f));
  EXPECT_FALSE(a.is_static());
  const auto x = at(a, 0.5), y = at(b, 0.5), later = at(a, 0.6);
  ASSERT_EQ(x.size(), y.size());
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(x[i].X_WO.p, y[i].X_WO.p);
  EXPECT_NE(x[0].X_WO.p, later[0].X_WO.p);
  EXPECT_NE(x[0].X_WO.p, at(make(flawed({.seed = 8, .noise_m = 0.01})), 0.5)[0].X_WO.p);
}

TEST(Flaws, NoiseAndDropoutAreAsLargeAsStated) {
  const Source s = make(flawed({.seed = 3, .noise_m = 0.01, .dropout = 0.25}));
  double sum = 0, squares = 0;
  std::size_t n = 0;
  for (int k = 0; k < 100; ++k)
    for (const Obstacle& o : at(s, k / 30.0)) {
      ++n;
      EXPECT_EQ(o.sigma_m, 0.01);
      const Eigen::Vector3d e = o.X_WO.p - Eigen::Vector3d(1.0 * o.id, 0, 0);
      sum += e.sum(), squares += e.squaredNorm();
    }
  EXPECT_NEAR(static_cast<double>(n) / 20000, 0.75, 0.02);
  EXPECT_NEAR(sum / static_cast<double>(3 * n), 0, 0.0005);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(3 * n)), 0.01, 0.0005);
}

TEST(Flaws, OnlyWhatIsInTheFieldOfViewIsSeen) {
  EXPECT_EQ(at(make(flawed({.range_m = 20.5})), 0).size(), 20u);
  EXPECT_EQ(at(make(flawed({.eye_m = {100.5, 0, 0}, .view_rad = 0.1})), 0).size(), 100u);
  EXPECT_TRUE(at(make(flawed({.look = {-1, 0, 0}, .view_rad = 0.1})), 0).empty());
}

TEST(Flaws, LatencyShowsThePastAndRulesAreKept) {
  scene::PerceptionOptions o;
  o.obstacles = {sphere(1, {0, 0, 0})};
  o.obstacles[0].velocity_mps = {1, 0, 0};
  o.flaws.emplace().latency_s = 0.1;
  EXPECT_NEAR(at(make(o), 0.5)[0].X_WO.p.x(), 0.4, 1e-12);
  EXPECT_EQ(at(make(o), 0.05)[0].X_WO.p.x(), 0);
  o.flaws->dropout = 2;
  EXPECT_FALSE(Source::make(o));
}

}  // namespace
}  // namespace hamel::perception
