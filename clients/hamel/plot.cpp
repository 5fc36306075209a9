#include "clients/hamel/plot.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>

#include "clients/hamel/gnuplot.h"
#include "common/rbd/rbd.h"
#include "common/runtime/options.h"
#include "services/perception/core/source.h"

namespace hamel::client {

namespace {

constexpr int kSnapshots = 12;  // arms drawn along the run
constexpr std::size_t kPathPoints = 800;

struct Row {
  double t_s = 0, clearance_m = 0, energy_J = 0;
  Eigen::VectorXd q;
  Eigen::Vector3d tip_m;
};

/// A plane of the world that is drawn: its two axes.
struct View {
  int across, up;
  const char* label_across;
  const char* label_up;
};

Result<std::vector<Row>, Problem> read_rows(const std::string& path, int n) {
  std::ifstream in(path);
  if (!in) return Problem{path, "cannot read"};
  std::string line;
  std::getline(in, line);
  std::map<std::string, std::size_t> column;
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) column.emplace(name, column.size());
  const auto at = [&](const std::string& name) {
    return column.contains(name) ? static_cast<long>(column[name]) : -1;
  };
  for (const std::string& name :
       {std::string("t_s"), std::string("q1"), fmt::format("q{}", n), std::string("ee_x_m"),
        std::string("ee_z_m"), std::string("clearance_m"), std::string("energy_J")})
    if (at(name) < 0)
      return Problem{path + ":1", "has no column " + name + ": written by --csv of this scene?"};
  std::vector<Row> rows;
  std::vector<double> v;
  for (int number = 2; std::getline(in, line); ++number) {
    v.clear();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) v.push_back(std::strtod(cell.c_str(), nullptr));
    if (v.size() != column.size())
      return Problem{fmt::format("{}:{}", path, number),
                     fmt::format("has {} cells, the header {}", v.size(), column.size())};
    Row r;
    r.t_s = v[column["t_s"]];
    r.clearance_m = v[column["clearance_m"]];
    r.energy_J = v[column["energy_J"]];
    r.q = Eigen::Map<Eigen::VectorXd>(v.data() + column["q1"], n);
    r.tip_m = Eigen::Map<Eigen::Vector3d>(v.data() + column["ee_x_m"]);
    rows.push_back(std::move(r));
  }
  if (rows.empty()) return Problem{path, "has no rows"};
  return rows;
}

/// Corners and rims of a solid, enough for an outline; world frame.
std::vector<Eigen::Vector3d> outline_points(const geometry::Obstacle& o) {
  std::vector<Eigen::Vector3d> points;
  const auto& d = o.shape.dims_m;
  const auto add = [&](double x, double y, double z) { points.push_back(o.X_WO * Eigen::Vector3d(x, y, z)); };
  const auto ball = [&](double radius, double z) {
    for (int i = 0; i < 24; ++i)
      for (int j = -5; j <= 5; ++j) {
        const double a = i * M_PI / 12, b = j * M_PI / 10;
        add(radius * std::cos(a) * std::cos(b), radius * std::sin(a) * std::cos(b), z + radius * std::sin(b));
      }
  };
  switch (o.shape.kind) {
    case geometry::ShapeKind::sphere:
      ball(d[0], 0);
      break;
    case geometry::ShapeKind::capsule:
      ball(d[0], d[1] / 2), ball(d[0], -d[1] / 2);
      break;
    case geometry::ShapeKind::cylinder:
      for (int i = 0; i < 24; ++i)
        for (const double z : {-d[1] / 2, d[1] / 2})
          add(d[0] * std::cos(i * M_PI / 12), d[0] * std::sin(i * M_PI / 12), z);
      break;
    case geometry::ShapeKind::box:
      for (const double x : {-0.5, 0.5})
        for (const double y : {-0.5, 0.5})
          for (const double z : {-0.5, 0.5}) add(x * d[0], y * d[1], z * d[2]);
      break;
    case geometry::ShapeKind::half_space:
      break;  // fills the picture: not drawn
  }
  return points;
}

using Point = std::pair<double, double>;

/// Convex hull, counter-clockwise (monotone chain).
std::vector<Point> hull(std::vector<Point> p) {
  std::sort(p.begin(), p.end());
  const auto cross = [](const Point& o, const Point& a, const Point& b) {
    return (a.first - o.first) * (b.second - o.second) - (a.second - o.second) * (b.first - o.first);
  };
  std::vector<Point> h;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = h.size();
    for (const Point& q : p) {
      while (h.size() >= base + 2 && cross(h[h.size() - 2], h.back(), q) <= 0) h.pop_back();
      h.push_back(q);
    }
    if (!h.empty()) h.pop_back();
    std::reverse(p.begin(), p.end());
  }
  return h;
}

void add_arms(Script& s, const scene::Scene& scene, const std::vector<Row>& rows, const View& v,
              const std::string& block) {
  rbd::Workspace ws(scene.robot.chain);
  s.add("${} << EOD\n", block);
  for (int k = 0; k <= kSnapshots; ++k) {
    // More pictures early, where the arm moves, than late, where it rests.
    const double part = std::pow(static_cast<double>(k) / kSnapshots, 3);
    const Row& r = rows[static_cast<std::size_t>(part * static_cast<double>(rows.size() - 1))];
    rbd::positions(scene.robot.chain, r.q, ws);
    const auto& base = scene.robot.chain.X_WB0().p;
    s.add("{} {}\n", base[v.across], base[v.up]);
    for (const auto& X : ws.X_WB) s.add("{} {}\n", X.p[v.across], X.p[v.up]);
    s.add("{} {}\n\n", r.tip_m[v.across], r.tip_m[v.up]);
  }
  s.add("EOD\n");
}

void add_obstacles(Script& s, const perception::Source& source, double end_s, double grow_m, const View& v,
                   const std::string& block) {
  std::vector<geometry::Obstacle> at;
  s.add("${} << EOD\n", block);
  const int times = source.is_static() ? 1 : 5;
  for (int k = 0; k < times; ++k) {
    source.at(times == 1 ? 0 : end_s * k / (times - 1), at);
    for (auto o : at) {
      o.shape.dims_m[0] += grow_m;
      std::vector<Point> flat;
      for (const auto& p : outline_points(o)) flat.emplace_back(p[v.across], p[v.up]);
      if (flat.empty()) continue;
      auto h = hull(std::move(flat));
      h.push_back(h.front());
      for (const auto& [x, y] : h) s.add("{} {}\n", x, y);
      s.add("\n");
    }
  }
  s.add("EOD\n");
}

/// gnuplot draws nothing of a block without points, but complains: an empty block is left out.
std::string script(const PlotArgs& args, const scene::Scene& scene, const std::vector<Row>& rows,
                   const perception::Source& source) {
  const bool flat = std::all_of(rows.begin(), rows.end(), [&](const Row& r) {
    return std::abs(r.tip_m.z() - rows[0].tip_m.z()) < 1e-9;
  });
  std::vector<View> views{{0, 1, "x", "y"}};
  if (!flat) views.push_back({0, 2, "x", "z"});
  std::vector<geometry::Obstacle> first;
  source.at(0, first);

  Script s;
  s.add("{}", terminal(args.out_path, 480 * static_cast<int>(views.size() + 1), 540));
  s.add("$path << EOD\n");
  const std::size_t stride = std::max<std::size_t>(1, rows.size() / kPathPoints);
  for (std::size_t i = 0; i < rows.size(); i += stride) {
    const Row& r = rows[i];
    const double error = scene.goal && scene.goal->kind != scene::GoalKind::joints
                             ? (r.tip_m - scene.goal->X_WG.p).norm()
                             : NAN;
    s.add("{} {} {} {} {} {} {}\n", r.tip_m.x(), r.tip_m.y(), r.tip_m.z(), r.t_s, r.clearance_m, error,
          r.energy_J);
  }
  s.add("EOD\n");
  for (std::size_t i = 0; i < views.size(); ++i) {
    add_arms(s, scene, rows, views[i], fmt::format("arms{}", i));
    if (first.empty()) continue;
    add_obstacles(s, source, rows.back().t_s, 0, views[i], fmt::format("solid{}", i));
    add_obstacles(s, source, rows.back().t_s, scene.planner.rho0_m, views[i], fmt::format("reach{}", i));
  }
  s.add("set multiplot layout 1,{} title '{}'\nset key outside bottom center horizontal\n", views.size() + 1,
        scene.name);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& v = views[i];
    s.add("set size ratio -1\nset xlabel '{} [m]'\nset ylabel '{} [m]'\nplot ", v.label_across, v.label_up);
    if (!first.empty())
      s.add(
          "$reach{} with lines dt 3 lc rgb '#999999' title 'influence', $solid{} with filledcurves fc rgb "
          "'#cc6644' title 'obstacle', ",
          i, i);
    s.add("$arms{} with linespoints pt 7 ps 0.3 lc rgb '#8899bb' title 'arm', ", i);
    s.add("$path using {}:{} with lines lw 2 lc rgb '#114488' title 'end effector'", v.across + 1, v.up + 1);
    if (scene.goal && scene.goal->kind != scene::GoalKind::joints)
      s.add(", '-' with points pt 2 ps 1.5 lw 2 lc rgb '#228833' title 'target'\n{} {}\ne",
            scene.goal->X_WG.p[v.across], scene.goal->X_WG.p[v.up]);
    s.add("\n");
  }
  s.add("set size noratio\nset xlabel 't [s]'\n");
  if (scene.steered)
    s.add(
        "set ylabel '[m]'\nset yrange [0:*]\nplot $path using 4:6 with lines lw 2 lc rgb '#228833' title "
        "'distance to target', "
        "$path using 4:5 with lines lw 2 lc rgb '#cc6644' title 'clearance'\n");
  else
    s.add(
        "set ylabel 'energy - energy(0) [J]'\nplot $path using 4:($7-({})) with lines lc rgb '#114488' "
        "notitle\n",
        rows[0].energy_J);
  s.add("unset multiplot\n");
  return s.str();
}

}  // namespace

int plot(const PlotArgs& args) {
  runtime::RunOptions o;
  o.scene_path = args.scene_path;
  o.overrides = args.overrides;
  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel plot", scene.error());
  if (const auto p = check_picture_name(args.out_path)) return runtime::complain("hamel plot", {*p});
  const auto rows = read_rows(args.csv_path, scene.value().robot.chain.n());
  if (!rows) return runtime::complain("hamel plot", {rows.error()});
  const auto source = perception::Source::make(scene.value().perception);
  if (!source) return runtime::complain("hamel plot", source.error());
  const std::string text = script(args, scene.value(), rows.value(), source.value());
  if (const auto p = draw(text, args.out_path)) return runtime::complain("hamel plot", {*p});
  return runtime::kDone;
}

}  // namespace hamel::client
