// The strict reader of obstacle streams.
#include "common/scene/stream.h"

#include <gtest/gtest.h>

namespace hamel::scene {
namespace {

const std::string kHeader = "t_s,id,x_m,y_m,z_m,radius_m\n";

void expect_problem(const std::string& text, const std::string& where, const std::string& what) {
  const auto r = parse_stream(text, "s.csv");
  ASSERT_FALSE(r) << text;
  for (const Problem& p : r.error())
    if (p.where == where && p.what.find(what) != std::string::npos) return;
  FAIL() << "not named in " << text << ", but " << to_string(r.error().front());
}

TEST(Stream, ReadsRowsWithCommentsAndEitherLineEnd) {
  const auto r = parse_stream("# by hand\r\n" + kHeader + "0,3,1,2,3,0.5\r\n\n1e-1,4,-1,-2.5,0,0", "s.csv");
  ASSERT_TRUE(r) << to_string(r.error().front());
  ASSERT_EQ(r.value().size(), 2u);
  EXPECT_EQ(r.value()[1].id, 4u);
  EXPECT_EQ(r.value()[1].t_s, 0.1);
  EXPECT_EQ(r.value()[0].p_m, Eigen::Vector3d(1, 2, 3));
}

TEST(Stream, RefusesEveryBadLineByItsNumber) {
  expect_problem("", "s.csv:0", "is empty");
  expect_problem("t,id,x,y,z,r\n0,0,0,0,0,1\n", "s.csv:1", "header is");
  expect_problem(kHeader, "s.csv:1", "has no rows");
  expect_problem(kHeader + "0,0,0,0,1\n", "s.csv:2", "has 5 columns");
  expect_problem(kHeader + "0,0,0,0,0,1,\n", "s.csv:2", "has 7 columns");
  expect_problem(kHeader + "0,0,0,zero,0,1\n", "s.csv:2", "y_m = \"zero\"");
  expect_problem(kHeader + "0,0,0,nan,0,1\n", "s.csv:2", "y_m = \"nan\"");
  expect_problem(kHeader + "0,0,inf,0,0,1\n", "s.csv:2", "x_m");
  expect_problem(kHeader + "0,0,1e999,0,0,1\n", "s.csv:2", "x_m");
  expect_problem(kHeader + "0,0, 1,0,0,1\n", "s.csv:2", "x_m");
  expect_problem(kHeader + "0,-1,0,0,0,1\n", "s.csv:2", "id = \"-1\"");
  expect_problem(kHeader + "0,1.5,0,0,0,1\n", "s.csv:2", "id");
  expect_problem(kHeader + "0,4294967296,0,0,0,1\n", "s.csv:2", "id");
  expect_problem(kHeader + "0,0,0,0,0,-1\n", "s.csv:2", "radius_m = -1");
  expect_problem(kHeader + "1,0,0,0,0,1\n0.5,0,0,0,0,1\n", "s.csv:3", "time goes backwards");
  expect_problem(kHeader + "1,0,0,0,0,1\n1,0,0,0,0,1\n", "s.csv:3", "id 0 occurs twice");
}

TEST(Stream, ListsAllBadLinesButNotWithoutEnd) {
  std::string text = kHeader + "x,0,0,0,0,1\n0,0,0,0,0,1\n0,1,0,y,0,-1\n";
  const auto r = parse_stream(text, "s.csv");
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().size(), 2u);
  for (int i = 0; i < 1000; ++i) text += "bad\n";
  EXPECT_LE(parse_stream(text, "s.csv").error().size(), 25u);
}

}  // namespace
}  // namespace hamel::scene
