/// Obstacle streams as files: the sets of a recording come back as samples.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "common/files/stream.h"
#include "common/record/writer.h"
#include "common/wire/codec.h"
#include "services/perception/core/source.h"

using namespace hamel;

namespace {

/// A recording of obstacle sets, closed at the end of its life.
class Recording {
 public:
  explicit Recording(const std::string& name)
      : path(testing::TempDir() + "/hamel_stream_" + std::to_string(getpid()) + "_" + name + ".mcap") {
    auto w = record::Writer::create(path, {});
    out_ = std::move(w).value();
    const Topic& topic = wire::topic_of<wire::ObstacleSet>();
    const auto schema = out_->add(record::Schema{0, std::string(topic.type), "omgidl", ""});
    channel_ = out_->add(record::Channel{0, schema, std::string(topic.name), "cdr", {}});
    other_ = out_->add(record::Channel{0, 0, "hamel/v1/clock", "cdr", {}});
  }
  void add(const wire::ObstacleSet& set) {
    bus::Payload p;
    ASSERT_TRUE(wire::encode(set, p));
    const auto t = static_cast<std::uint64_t>(set.t_s * 1e9);
    out_->write(record::Message{channel_, 0, t, t, p}, {});
  }
  void clock(double t_s) {
    const auto t = static_cast<std::uint64_t>(t_s * 1e9);
    out_->write(record::Message{other_, 0, t, t, {}}, {});
  }
  Checked<files::StreamFile> read(const std::string& topic = "obstacles") {
    out_->close();
    return files::load_stream(path, topic);
  }
  const std::string path;

 private:
  std::unique_ptr<record::Writer> out_;
  std::uint16_t channel_ = 0, other_ = 0;
};

wire::ObstacleSet set_at(double t_s, double x_m, double speed_mps = 1) {
  wire::ObstacleSet s;
  s.source = 1, s.t_s = t_s, s.next_t_s = t_s + 0.1;
  geometry::Obstacle& o = s.obstacles.emplace_back();
  o.id = 7, o.shape = {geometry::ShapeKind::capsule, {0.1, 0.5, 0}};
  o.X_WO.p = {x_m, 2, 3};
  o.X_WO.R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  o.V_WO << 0, 0, 0, speed_mps, 0, 0;
  o.sigma_m = 0.01;
  return s;
}

TEST(StreamFile, SetsOfARecordingAreSamplesAtTheirTimes) {
  Recording r("plain");
  for (int k = 0; k < 5; ++k) r.add(set_at(2 + 0.1 * k, 0.3 * k));
  r.add(set_at(2.2, 99));  // said again
  wire::ObstacleSet nobody = set_at(2.5, 0);
  nobody.obstacles.clear();
  r.add(nobody);
  const auto file = r.read();
  ASSERT_TRUE(file) << to_string(file.error().front());
  const files::StreamFile& s = file.value();
  ASSERT_EQ(s.samples.size(), 5u);
  EXPECT_EQ(s.first_s, 2);
  EXPECT_EQ(s.empty_s, std::vector<double>{2.5});
  EXPECT_EQ(s.samples[3].t_s, 2 + 0.1 * 3);
  EXPECT_EQ(s.samples[3].id, 7u);
  EXPECT_EQ(s.samples[3].p_m, Eigen::Vector3d(0.3 * 3, 2, 3));
  EXPECT_EQ(s.samples[3].shape.kind, geometry::ShapeKind::capsule);
  EXPECT_EQ(s.samples[3].shape.dims_m, Eigen::Vector3d(0.1, 0.5, 0));
  EXPECT_LT((s.samples[3].R_SO - set_at(0, 0).obstacles[0].X_WO.R).norm(), 1e-15);
  EXPECT_EQ(s.samples[3].sigma_m, 0.01);

  scene::PerceptionOptions options;
  options.stream.emplace().samples = s.samples;
  options.stream->start_s = 2;
  std::vector<geometry::Obstacle> out;
  ASSERT_TRUE(perception::Source::make(options).value().at(0.15, out));
  EXPECT_NEAR(out.at(0).V_WO[3], 3, 1e-9) << "estimated from the places, as for a CSV";
}

TEST(StreamFile, ASetThatHoldsIsNoGap) {
  Recording r("holds");
  wire::ObstacleSet still = set_at(0, 1, 0);
  still.next_t_s = wire::kInf;
  r.add(still);
  r.clock(5);
  const auto file = r.read("hamel/v1/obstacles");
  ASSERT_TRUE(file);
  ASSERT_EQ(file.value().samples.size(), 10u);
  EXPECT_EQ(file.value().samples.back().t_s, 4.5);
}

TEST(StreamFile, ASilenceOfMovingObstaclesStaysAGap) {
  Recording r("gap");
  wire::ObstacleSet before = set_at(0, 1);
  before.next_t_s = 3;
  r.add(before), r.add(set_at(3, 2));
  ASSERT_EQ(r.read().value().samples.size(), 2u);
}

TEST(StreamFile, WhatCannotServeIsRefusedByName) {
  const auto expect = [](const Checked<files::StreamFile>& f, const std::string& what) {
    ASSERT_FALSE(f);
    EXPECT_NE(to_string(f.error().front()).find(what), std::string::npos) << to_string(f.error().front());
  };
  Recording none("none");
  none.clock(1);
  expect(none.read(), "holds no obstacle set of topic obstacles");
  Recording two("two");
  wire::ObstacleSet other = set_at(1, 0);
  other.source = 2;
  two.add(set_at(0, 0)), two.add(other);
  expect(two.read(), "source 1 and of 2");
  Recording kind("kind");
  kind.add(set_at(0, 0));
  kind.clock(1);
  expect(kind.read("clock"), "must be hamel::v1::ObstacleSet");
  Recording cut("cut");
  cut.add(set_at(0, 0));
  ASSERT_TRUE(cut.read());
  std::filesystem::resize_file(cut.path, std::filesystem::file_size(cut.path) - 20);
  expect(files::load_stream(cut.path, "obstacles"), "hamel log recover");
}

}  // namespace
