#include "clients/hamel/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "clients/hamel/gnuplot.h"
#include "clients/hamel/motion.h"
#include "common/rbd/rbd.h"
#include "common/runtime/options.h"
#include "services/dynamics/core/integrator.h"

namespace hamel::client {

namespace {

using dynamics::Options;
using scene::Tier;

constexpr double kStill_m = 1e-9;  // a way so short is no motion

/// One tier's motion, a row each step.
struct Course {
  std::vector<std::vector<Eigen::Vector3d>> com_m;  ///< of each link
  std::vector<double> height_m;                     ///< of the end effector
  std::vector<int> iterations;
  std::vector<double> residual_Nm;
};

/// The paper, literally: start from q^{k+1} = q^k, feedback (16), stop below 1e-8 N m.
Options paper(const scene::Scene& s) {
  Options o = s.dynamics;
  o.tier = Tier::hamel, o.alpha = 0.5, o.root = scene::Root::feedback, o.start = scene::Start::previous;
  o.tolerance_Nm = 1e-8;
  return o;
}

Options other(const scene::Scene& s, Tier tier) {
  Options o = s.dynamics;
  o.tier = tier, o.stages = 6, o.tolerance_Nm = 0;
  return o;
}

Result<Course, Problem> integrate(const scene::Scene& s, const Options& options,
                                  const runtime::StopSignal& stop) {
  const model::Chain& chain = s.robot.chain;
  dynamics::Integrator integrator(chain, options);
  dynamics::State state = integrator.start(s.q0, s.qd0);
  rbd::Workspace ws(chain);
  const Eigen::VectorXd tau = Eigen::VectorXd::Zero(chain.n());
  const Eigen::Vector3d g = chain.gravity_W_mps2();
  const Eigen::Vector3d up = g.norm() > 0 ? Eigen::Vector3d(-g.normalized()) : Eigen::Vector3d::UnitZ();
  Course c;
  dynamics::StepReport report;
  const auto steps = std::llround(s.duration_s / options.dt_s);
  for (long long k = 0; k <= steps && !stop.requested(); ++k) {
    if (k > 0) report = integrator.step(state, tau);
    if (k > 0 && !report.usable())
      return Problem{scene::to_string(options.tier),
                     fmt::format("refused the step at t = {} s", static_cast<double>(k) * options.dt_s)};
    rbd::positions(chain, state.q, ws);
    std::vector<Eigen::Vector3d>& row = c.com_m.emplace_back();
    for (int i = 0; i < chain.n(); ++i)
      row.push_back(ws.X_WB[static_cast<std::size_t>(i)] * chain.link(i).inertia.com_m);
    c.height_m.push_back(up.dot(rbd::tip(chain, ws).p));
    c.iterations.push_back(k > 0 ? report.iterations : 0);
    c.residual_Nm.push_back(k > 0 ? report.residual_Nm : 0);
  }
  return c;
}

/// The three files of one figure.
class Figure {
 public:
  Figure(const std::filesystem::path& folder, std::string name, std::string header)
      : folder_(folder), name_(std::move(name)) {
    csv_ = header + "\n";
  }
  void row(const std::vector<double>& cells) {
    for (std::size_t i = 0; i < cells.size(); ++i)
      fmt::format_to(std::back_inserter(csv_), "{}{}", cells[i], i + 1 < cells.size() ? "," : "\n");
  }
  /// `body` draws from the file $csv, column names in its first line.
  std::optional<Problem> finish(int width, int height, const std::string& body) const {
    const std::string csv = (folder_ / (name_ + ".csv")).string();
    std::ofstream out(csv);
    out << csv_;
    out.flush();
    if (!out) return Problem{csv, "cannot be written"};
    for (const char* extension : {".svg", ".png"}) {
      const std::string picture = (folder_ / (name_ + extension)).string();
      const std::string script = terminal(picture, width, height) +
                                 "set datafile separator ','\ncsv = " + quoted(csv) + "\nset grid\n" + body;
      if (auto p = draw(script, picture)) return p;
    }
    return std::nullopt;
  }

 private:
  std::filesystem::path folder_;
  std::string name_, csv_;
};

/// An axis of some length where nothing changes, else gnuplot's own.
std::string y_range(double low, double high) {
  return high - low > kStill_m ? "set yrange [*:*]\n"
                               : fmt::format("set yrange [{}:{}]\n", low - 1, high + 1);
}

/// The two world axes along which the centres of mass move most.
std::pair<int, int> plane(const Course& c) {
  Eigen::Vector3d low = c.com_m[0][0], high = low;
  for (const auto& row : c.com_m)
    for (const auto& p : row) low = low.cwiseMin(p), high = high.cwiseMax(p);
  int flat = 0;
  (high - low).minCoeff(&flat);
  return {flat == 0 ? 1 : 0, flat == 2 ? 1 : 2};
}

std::optional<Problem> figure3(const std::filesystem::path& folder, const scene::Scene& s, const Course& c) {
  std::string header = "t_s";
  for (int i = 1; i <= s.robot.chain.n(); ++i) header += fmt::format(",com{0}_x_m,com{0}_y_m,com{0}_z_m", i);
  Figure f(folder, "figure3", header);
  for (std::size_t k = 0; k < c.com_m.size(); ++k) {
    std::vector<double> cells{static_cast<double>(k) * s.dynamics.dt_s};
    for (const auto& p : c.com_m[k]) cells.insert(cells.end(), {p.x(), p.y(), p.z()});
    f.row(cells);
  }
  const auto [across, up] = plane(c);
  std::string body = fmt::format(
      "set size ratio -1\nset key outside\nset xlabel '{} [m]'\nset ylabel '{} [m]'\n"
      "set title 'Paths of the centres of mass, {:g} s'\nplot ",
      "xyz"[across], "xyz"[up], s.duration_s);
  double low = c.com_m[0][0][up], high = low;
  for (const auto& row : c.com_m)
    for (const auto& p : row) low = std::min(low, p[up]), high = std::max(high, p[up]);
  body.insert(0, y_range(low, high));
  for (int i = 0; i < s.robot.chain.n(); ++i)
    body += fmt::format("{}csv using {}:{} skip 1 with lines title 'link {}'", i ? ", " : "",
                        3 * i + 2 + across, 3 * i + 2 + up, i + 1);
  return f.finish(760, 440, body + "\n");
}

std::optional<Problem> figure4(const std::filesystem::path& folder, const scene::Scene& s,
                               const Course& hamel, const Course& euler, const Course& midpoint,
                               const Course& truth) {
  Figure f(folder, "figure4",
           "t_s,height_hamel_m,height_semi_implicit_euler_m,height_midpoint_m,height_reference_m");
  for (std::size_t k = 0; k < hamel.height_m.size(); ++k)
    f.row({static_cast<double>(k) * s.dynamics.dt_s, hamel.height_m[k], euler.height_m[k],
           midpoint.height_m[k], truth.height_m[k]});
  const auto [low, high] = std::minmax_element(truth.height_m.begin(), truth.height_m.end());
  double most_m = 0;
  for (std::size_t k = 0; k < hamel.height_m.size(); ++k)
    for (const Course* c : {&hamel, &euler, &midpoint})
      most_m = std::max(most_m, std::abs(c->height_m[k] - truth.height_m[k]));
  return f.finish(
      1000, 640,
      "set multiplot layout 2,1\nset key outside\nset xlabel 't [s]'\nset ylabel 'height [m]'\n" +
          y_range(*low, *high) +
          "set title 'End effector'\n"
          "plot csv using 1:5 skip 1 with lines lw 2 lc rgb '#bbbbbb' title 'reference', "
          "csv using 1:2 skip 1 with lines lc rgb '#114488' title 'hamel, Eq. (13)', "
          "csv using 1:3 skip 1 with lines dt 2 lc rgb '#cc6644' title 'semi-implicit Euler'\n"
          "set title 'Distance from the reference'\nset logscale y\nset yrange [" +
          (most_m > 1e-7 ? "1e-8" : "1e-13") +
          ":*]\nset format y "
          "'1e%T'\nset ylabel '[m]'\n"
          "plot csv using 1:(abs($2-$5)+1e-12) skip 1 with lines lc rgb '#114488' title 'hamel, Eq. (13)', "
          "csv using 1:(abs($3-$5)+1e-12) skip 1 with lines lc rgb '#cc6644' title 'semi-implicit Euler', "
          "csv using 1:(abs($4-$5)+1e-12) skip 1 with lines lc rgb '#228833' title 'midpoint'\n"
          "unset multiplot\n");
}

std::optional<Problem> figure5(const std::filesystem::path& folder, const scene::Scene& s, const Course& c) {
  Figure f(folder, "figure5", "t_s,iterations,residual_Nm");
  for (std::size_t k = 1; k < c.iterations.size(); ++k)
    f.row({static_cast<double>(k) * s.dynamics.dt_s, static_cast<double>(c.iterations[k]), c.residual_Nm[k]});
  const int most = *std::max_element(c.iterations.begin(), c.iterations.end());
  return f.finish(
      1000, 640,
      fmt::format("set multiplot layout 2,1\nset key off\nset xlabel 't [s]'\nset ylabel 'iterations'\n"
                  "set yrange [0:{}]\nset ytics 1\nset title 'Feedback (16) at every step'\n"
                  "plot csv using 1:2 skip 1 with points pt 7 ps 0.2 lc rgb '#114488'\n"
                  "set yrange [1e-15:1e-7]\nset ytics auto\nset logscale y\nset format y '1e%T'\n"
                  "set ylabel 'residual [N m]'\nset title 'Torque left unbalanced'\n"
                  "plot csv using 1:($3+1e-18) skip 1 with points pt 7 ps 0.2 lc rgb '#114488', 1e-8 lc rgb "
                  "'#cc6644'\n"
                  "unset multiplot\n",
                  most + 1));
}

/// True where some centre of mass leaves its place.
bool moves(const Course& c) {
  for (const auto& row : c.com_m)
    for (std::size_t i = 0; i < row.size(); ++i)
      if ((row[i] - c.com_m[0][i]).norm() > kStill_m) return true;
  return false;
}

/// Nothing is written before all is known to be there.
std::optional<Problem> draw_all(const std::filesystem::path& folder, const scene::Scene& s,
                                const runtime::StopSignal& stop) {
  if (s.steered) return Problem{s.name, "is steered; the paper's figures show a free motion"};
  std::vector<Course> courses;
  for (const Options& o :
       {paper(s), other(s, Tier::semi_implicit_euler), other(s, Tier::midpoint), other(s, Tier::gauss)}) {
    auto course = integrate(s, o, stop);
    if (!course) return course.error();
    if (stop.requested()) return std::nullopt;
    courses.push_back(std::move(course).value());
    if (!moves(courses[0])) return Problem{s.name, "does not move: it is at rest, and nothing pulls at it"};
  }
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Problem{folder.string(), "cannot be made: " + error.message()};
  if (auto p = figure3(folder, s, courses[0])) return p;
  if (auto p = figure4(folder, s, courses[0], courses[1], courses[2], courses[3])) return p;
  if (auto p = figure5(folder, s, courses[0])) return p;
  const int most = *std::max_element(courses[0].iterations.begin(), courses[0].iterations.end());
  const double residual = *std::max_element(courses[0].residual_Nm.begin(), courses[0].residual_Nm.end());
  fmt::print(
      "figures 3, 4 and 5 in {} (csv, svg, png): {} steps, at most {} iterations, residual below {:.1e} N "
      "m\n",
      folder.string(), courses[0].iterations.size() - 1, most, residual);
  return std::nullopt;
}

}  // namespace

int figures(const FiguresArgs& args) {
  const auto work = [&](const scene::Scene& scene, const runtime::StopSignal& stop) {
    const auto p = draw_all(args.folder, scene, stop);
    return p ? runtime::complain("hamel figures", {*p}) : int{runtime::kDone};
  };
  return on_motion("hamel figures", args.scene_path, args.overrides, work);
}

}  // namespace hamel::client
