#include "common/scene/self_links.h"

#include <algorithm>
#include <numbers>

#include "common/base/even.h"
#include "common/geometry/solid.h"
#include "common/rbd/rbd.h"

namespace hamel::scene {
namespace {

constexpr int kSamples = 500;
constexpr double kAlways = 0.95;  // of the samples

struct LinkPair {
  int a = 0, b = 0, touched = 0;
};

// The k-th of configurations that fill the limits evenly.
Eigen::VectorXd sample(const model::Chain& chain, int k) {
  Eigen::VectorXd q(chain.n());
  const std::vector<double> u = even_point(chain.n(), k + 1);
  for (int i = 0; i < chain.n(); ++i) {
    const model::JointLimits& limits = chain.joint(i).limits;
    const double low = std::max(limits.lower, -std::numbers::pi),
                 high = std::min(limits.upper, std::numbers::pi);
    q[i] = low + u[static_cast<std::size_t>(i)] * (high - low);
  }
  return q;
}

bool touch(const Robot& robot, const std::vector<geometry::Solid>& solids, const LinkPair& pair) {
  for (std::size_t i = 0; i < solids.size(); ++i)
    for (std::size_t j = 0; j < solids.size(); ++j) {
      if (robot.shapes[i].link != pair.a || robot.shapes[j].link != pair.b) continue;
      if (geometry::distance_bound(solids[j], solids[i]) > 0) continue;
      if (geometry::closest(solids[j], solids[i]).distance_m < 0) return true;
    }
  return false;
}

}  // namespace

SelfLinks self_links(const Robot& robot, const std::vector<std::pair<int, int>>& allowed) {
  const model::Chain& chain = robot.chain;
  const auto has_shape = [&](int link) {
    return std::any_of(robot.shapes.begin(), robot.shapes.end(),
                       [&](const LinkShape& s) { return s.link == link; });
  };
  std::vector<LinkPair> pairs;
  for (int b = 1; b < chain.n(); ++b)
    for (int a = -1; a < b - 1; ++a)
      if (has_shape(a) && has_shape(b) && std::count(allowed.begin(), allowed.end(), std::pair{a, b}) == 0)
        pairs.push_back({a, b});
  rbd::Workspace ws(chain);
  std::vector<geometry::Solid> solids(robot.shapes.size());
  for (int k = 0; k < kSamples; ++k) {
    rbd::positions(chain, sample(chain, k), ws);
    for (std::size_t i = 0; i < solids.size(); ++i) {
      const LinkShape& s = robot.shapes[i];
      solids[i] = geometry::solid(
          s.shape, (s.link < 0 ? chain.X_WB0() : ws.X_WB[static_cast<std::size_t>(s.link)]) * s.X_LS);
    }
    for (LinkPair& pair : pairs) pair.touched += touch(robot, solids, pair);
  }
  SelfLinks out;
  for (const LinkPair& pair : pairs)
    (pair.touched >= kAlways * kSamples ? out.touching : out.watched).emplace_back(pair.a, pair.b);
  return out;
}

void watch(Robot& robot, const std::vector<std::pair<int, int>>& links) {
  robot.self_pairs.clear();
  for (std::size_t b = 0; b < robot.shapes.size(); ++b)
    for (std::size_t a = 0; a < robot.shapes.size(); ++a) {
      const std::pair both{robot.shapes[a].link, robot.shapes[b].link};
      if (std::count(links.begin(), links.end(), both) > 0) robot.self_pairs.emplace_back(a, b);
    }
}

}  // namespace hamel::scene
