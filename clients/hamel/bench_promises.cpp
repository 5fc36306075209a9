#include "clients/hamel/bench_promises.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace hamel::client {

namespace {

constexpr double kNone = -1;

/// Parts of all trials; times in us; kNone: nothing promised.
struct Promise {
  const char* family;
  int spheres;  ///< 0: all cells of the family together
  double single, with_rollouts;
  double contact = 0;
  double variation = kNone, p50_us = kNone, p99_us = kNone;
};

constexpr std::array kPromises{
    Promise{"planar_static", 1, 0.98, 0.98},
    Promise{"planar_static", 2, 0.97, 0.98},
    Promise{"planar_static", 4, 0.93, 0.96},
    Promise{"planar_static", 8, 0.93, 0.95},
    Promise{"panda_static", 1, 0.94, 0.94},
    Promise{"panda_static", 4, 0.95, 0.95},
    Promise{"panda_static", 8, 0.96, 0.96, 0, 100},
    Promise{"panda_static", 16, 0.93, 0.93, 0, kNone, 20, 100},
    Promise{"panda_static", 0, 0.96, 0.98},
    Promise{"panda_moving", 1, 0.93, 0.93, 1},
    Promise{"panda_moving", 4, 0.93, 0.93, 1},
    Promise{"panda_moving", 8, 0.93, 0.93, 1},
    Promise{"panda_moving", 0, 0.94, 0.94, 0.005},
    Promise{"panda_crowd", 256, kNone, kNone, 0, kNone, 200},
    Promise{"example_5_2", 1, 0.97, 0.97},
    Promise{"example_5_2_grid", 0, 0.95, 0.95},
};
constexpr double kCoarse_s = 0.002,
                 kContactCoarse = 0.01;  // larger steps: moving spheres may touch more often

/// The trials of method gyro in some cells, together.
struct Sum {
  std::uint64_t trials = 0, reached = 0, touched = 0;
};

Sum& operator+=(Sum& sum, const Tally& t) {
  for (const Figures& f : t.all()) {
    ++sum.trials;
    sum.reached += f.ending == Ending::reached;
    sum.touched += f.ending == Ending::collided;
  }
  return sum;
}

const Tally* gyro(const CellTally& cell) {
  const auto at = std::find(cell.methods.begin(), cell.methods.end(), "gyro");
  return at == cell.methods.end() ? nullptr
                                  : &cell.tallies[static_cast<std::size_t>(at - cell.methods.begin())];
}

void judge_rates(const std::string& what, const Sum& sum, const Promise& p, const BenchConditions& made,
                 std::vector<std::string>& missed) {
  const double floor = made.rollouts ? p.with_rollouts : p.single;
  const Rate reach = wilson(sum.reached, sum.trials);
  if (reach.low < floor)
    missed.push_back(fmt::format("{}: reached {:.1f} % of {}, at least {:.1f} %, promised {:.1f} %", what,
                                 100 * reach.value, sum.trials, 100 * reach.low, 100 * floor));
  const double most =
      p.contact > 0 && made.dt_s > kCoarse_s ? std::max(p.contact, kContactCoarse) : p.contact;
  if (static_cast<double>(sum.touched) > most * static_cast<double>(sum.trials))
    missed.push_back(
        fmt::format("{}: {} contacts in {}, promised {:.1f} %", what, sum.touched, sum.trials, 100 * most));
}

void judge_values(const std::string& what, const Tally& t, const Promise& p,
                  std::vector<std::string>& missed) {
  const auto most = [&](const char* name, double value, double promised) {
    if (promised != kNone && !(value <= promised))
      missed.push_back(fmt::format("{}: {} {:.1f}, promised {:.0f}", what, name, value, promised));
  };
  most("variation of accelerations", t.jerkiness(), p.variation);
  most("cycle us, median", 1e6 * t.cycle().quantile(0.5), p.p50_us);
  most("cycle us, 99 of 100", 1e6 * t.cycle().quantile(0.99), p.p99_us);
}

}  // namespace

std::vector<std::string> missed_promises(const std::vector<CellTally>& all, const BenchConditions& made) {
  std::vector<std::string> missed;
  for (const Promise& p : kPromises) {
    Sum together;
    for (const CellTally& cell : all) {
      const Tally* t = gyro(cell);
      if (!t || cell.cell.family != p.family) continue;
      if (p.spheres == 0) together += *t;
      if (p.spheres != cell.cell.spheres) continue;
      Sum sum;
      judge_rates(label(cell.cell), sum += *t, p, made, missed);
      judge_values(label(cell.cell), *t, p, missed);
    }
    if (together.trials > 0) judge_rates(std::string(p.family) + " together", together, p, made, missed);
  }
  return missed;
}

}  // namespace hamel::client
