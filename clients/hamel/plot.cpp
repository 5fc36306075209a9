#include "clients/hamel/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/hamel/course.h"
#include "clients/hamel/gnuplot.h"
#include "clients/hamel/outline.h"
#include "common/rbd/rbd.h"
#include "common/runtime/options.h"

namespace hamel::client {

namespace {

constexpr int kSnapshots = 12;  // arms drawn along the run
constexpr const char* kDots = "points pt 7 ps 0.2";

/// A plane of the world that is drawn: its two axes.
struct View {
  int across, up;
  const char* label_across;
  const char* label_up;
  Eigen::Array2d least{HUGE_VAL, HUGE_VAL}, most{-HUGE_VAL, -HUGE_VAL};  ///< of what is drawn

  void cover(double x, double y) {
    least = least.min(Eigen::Array2d(x, y));
    most = most.max(Eigen::Array2d(x, y));
  }
  double span() const { return (most - least).maxCoeff(); }
};

/// A step of 1, 2 or 5 times a power of ten that parts `span` into three to eight.
double tic_step(double span) {
  const double third = span / 3, ten = std::pow(10, std::floor(std::log10(third)));
  return third >= 5 * ten ? 5 * ten : third >= 2 * ten ? 2 * ten : ten;
}

bool has_target(const Course& c) {
  return c.scene && c.scene->goal && c.scene->goal->kind != scene::GoalKind::joints;
}

/// One script: data blocks first, then a panel after the other.
class Picture {
 public:
  Picture(const Course& course, std::vector<std::string> kinds) : c_(course), kinds_(std::move(kinds)) {
    const auto flat = [&](int axis) {
      return std::all_of(c_.rows.begin(), c_.rows.end(), [&](const Row& r) {
        return !(std::abs(r.tip_m[axis] - c_.rows[0].tip_m[axis]) > 1e-9);
      });
    };
    if (!flat(0) || !flat(1)) views_.push_back({0, 1, "x", "y"});
    if (!flat(2)) views_.push_back({flat(0) ? 1 : 0, 2, flat(0) ? "y" : "x", "z"});
  }

  std::string script(const std::string& out_path) {
    const bool path = std::count(kinds_.begin(), kinds_.end(), "path") > 0;
    const std::size_t panels = kinds_.size() + (path ? views_.size() - 1 : 0);
    const std::size_t columns = std::min<std::size_t>(panels, 3), rows = (panels + columns - 1) / columns;
    s_.add("{}", terminal(out_path, 480 * static_cast<int>(columns), 60 + 480 * static_cast<int>(rows)));
    add_rows();
    if (path) add_bodies();
    s_.add("set multiplot layout {},{} title {}\n", rows, columns, quoted(c_.name));
    for (const std::string& kind : kinds_) {
      if (kind == "path")
        for (std::size_t i = 0; i < views_.size(); ++i) path_panel(i);
      else
        panel(kind);
    }
    s_.add("unset multiplot\n");
    return s_.str();
  }

 private:
  /// 1 t, 2-4 end effector, 5 clearance, 6 error, 7 energy, 8 iterations, 9-11 latencies in ms, 12.. bodies.
  void add_rows() {
    std::optional<rbd::Workspace> ws;
    if (c_.scene) ws.emplace(c_.scene->robot.chain);
    s_.add("$rows << EOD\n");
    for (const Row& r : c_.rows) {
      for (const double v :
           {r.t_s, r.tip_m.x(), r.tip_m.y(), r.tip_m.z(), r.clearance_m, r.error_m, r.energy_J, r.iterations,
            r.planner_s * 1e3, r.command_age_s * 1e3, r.obstacle_age_s * 1e3})
        number(v);
      if (ws) {
        rbd::positions(c_.scene->robot.chain, r.q, *ws);
        for (const auto& X : ws->X_WB)
          for (const double v : X.p) number(v);
      }
      s_.add("\n");
    }
    s_.add("EOD\n");
  }
  void number(double v) {
    if (std::isfinite(v))
      s_.add("{:.7g} ", v);
    else
      s_.add("NaN ");
  }

  void add_bodies() {
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (c_.scene) add_arms(i);
      add_outlines(i, 0, "solid");
      if (c_.scene) add_outlines(i, c_.scene->planner.rho0_m, "reach");
    }
  }
  void add_arms(std::size_t i) {
    const View& v = views_[i];
    const model::Chain& chain = c_.scene->robot.chain;
    rbd::Workspace ws(chain);
    s_.add("$arms{} << EOD\n", i);
    for (int k = 0; k <= kSnapshots; ++k) {
      // More pictures early, where the arm moves, than late, where it rests.
      const double part = std::pow(static_cast<double>(k) / kSnapshots, 3);
      const Row& r = c_.rows[static_cast<std::size_t>(part * static_cast<double>(c_.rows.size() - 1))];
      rbd::positions(chain, r.q, ws);
      const auto& base = chain.X_WB0().p;
      point(i, base[v.across], base[v.up]);
      for (const auto& X : ws.X_WB) point(i, X.p[v.across], X.p[v.up]);
      point(i, r.tip_m[v.across], r.tip_m[v.up]);
      s_.add("\n");
    }
    s_.add("EOD\n");
  }
  /// gnuplot complains about a block without points: has_outlines_ tells whether to draw it.
  void add_outlines(std::size_t i, double grow_m, const char* block) {
    s_.add("${}{} << EOD\n", block, i);
    for (const auto& set : c_.obstacles)
      for (const auto& o : set) {
        const auto points = outline(o, grow_m, views_[i].across, views_[i].up);
        has_outlines_ |= !points.empty();
        for (const auto& [x, y] : points) point(i, x, y);
        s_.add("\n");
      }
    s_.add("EOD\n");
  }

  void point(std::size_t i, double x, double y) {
    s_.add("{} {}\n", x, y);
    views_[i].cover(x, y);
  }

  void path_panel(std::size_t i) {
    View& v = views_[i];
    for (const Row& r : c_.rows) v.cover(r.tip_m[v.across], r.tip_m[v.up]);
    // Both axes have one scale: labels of one step do not meet on the shorter one either.
    if (std::isfinite(v.span()) && v.span() > 0)
      s_.add("set xtics {0:g}\nset ytics {0:g}\n", tic_step(v.span()));
    s_.add(
        "set size ratio -1\nset yrange [*:*]\nset key outside bottom center horizontal\nset xlabel '{} "
        "[m]'\nset ylabel '{} [m]'\nplot ",
        v.label_across, v.label_up);
    if (has_outlines_ && c_.scene) s_.add("$reach{} with lines dt 3 lc rgb '#999999' title 'influence', ", i);
    if (has_outlines_) s_.add("$solid{} with filledcurves fc rgb '#cc6644' title 'obstacle', ", i);
    if (c_.scene) {
      s_.add("$arms{} with linespoints pt 7 ps 0.3 lc rgb '#8899bb' title 'arm', ", i);
      // The first body turns in its place.
      for (int k = 1; k < c_.scene->robot.chain.n(); ++k)
        s_.add("$rows using {}:{} with lines lc rgb '#aaccaa' {}, ", 12 + 3 * k + v.across, 12 + 3 * k + v.up,
               k == 1 ? "title 'links'" : "notitle");
    }
    s_.add("$rows using {}:{} with lines lw 2 lc rgb '#114488' title 'end effector'", v.across + 2, v.up + 2);
    if (has_target(c_))
      s_.add(", '-' with points pt 2 ps 1.5 lw 2 lc rgb '#228833' title 'target'\n{} {}\ne",
             c_.scene->goal->X_WG.p[v.across], c_.scene->goal->X_WG.p[v.up]);
    s_.add("\n");
  }

  bool any(double Row::*member) const {
    return std::any_of(c_.rows.begin(), c_.rows.end(),
                       [&](const Row& r) { return std::isfinite(r.*member); });
  }
  void panel(const std::string& kind) {
    s_.add(
        "set size noratio\nset xtics autofreq\nset ytics autofreq\nset xlabel 't [s]'\nset yrange [*:*]\nset "
        "key outside top center vertical\n");
    if (kind == "clearance") {
      s_.add("set ylabel '[m]'\nplot 0 lc rgb '#888888' notitle");
      line(any(&Row::error_m), 6, "#228833", "distance to target");
      line(any(&Row::clearance_m), 5, "#cc6644", "clearance");
    } else if (kind == "energy") {
      s_.add(
          "set ylabel 'energy - energy(0) [J]'\nplot $rows using 1:($7-({:.17g})) with lines lc rgb "
          "'#114488' notitle",
          c_.rows[0].energy_J);
    } else if (kind == "iterations") {
      s_.add(
          "set ylabel 'iterations of a step, at most'\nset yrange [0:*]\nset offsets 0,0,0.5,0\n"
          "plot $rows using 1:8 with steps lc rgb '#114488' notitle");
    } else {
      s_.add("set ylabel '[ms]'\nset logscale y\nset yrange [1e-3:*]\nplot NaN notitle");
      line(any(&Row::planner_s), 9, "#114488", "planner, wall time of a cycle", kDots);
      line(any(&Row::command_age_s), 10, "#cc6644", "command, age when applied", kDots);
      line(any(&Row::obstacle_age_s), 11, "#228833", "obstacles, age when used", kDots);
    }
    s_.add("\nunset logscale y\nset offsets 0,0,0,0\n");
  }
  void line(bool there, int column, const char* color, const char* title, const char* style = "lines") {
    if (there) s_.add(", $rows using 1:{} with {} lc rgb '{}' title '{}'", column, style, color, title);
  }

  const Course& c_;
  const std::vector<std::string> kinds_;
  std::vector<View> views_;
  bool has_outlines_ = false;
  Script s_;
};

/// The panels asked for, or those that suit the run; a problem where the file does not hold what they show.
Result<std::vector<std::string>, Problem> panels(const PlotArgs& args, const Course& c) {
  const auto holds = [&](double Row::*member) {
    return std::any_of(c.rows.begin(), c.rows.end(), [&](const Row& r) { return std::isfinite(r.*member); });
  };
  const bool latencies = holds(&Row::planner_s) || holds(&Row::command_age_s);
  const bool clearance = holds(&Row::clearance_m) || holds(&Row::error_m);
  if (args.kinds.empty()) return std::vector<std::string>{"path", clearance ? "clearance" : "energy"};
  std::vector<std::string> out;
  for (const std::string& kind : args.kinds) {
    if (kind == "all") {
      out = {"path", "energy", "iterations"};
      if (clearance) out.insert(out.begin() + 1, "clearance");
      if (latencies) out.push_back("latencies");
      return out;
    }
    if (kind == "latencies" && !latencies)
      return Problem{args.path, "holds no latencies: a recording (.mcap) of a steered run does"};
    if (kind == "clearance" && !clearance)
      return Problem{args.path, "holds no clearance: nothing was in range, or nothing was steered"};
    out.push_back(kind);
  }
  return out;
}

}  // namespace

int plot(const PlotArgs& args) {
  if (const auto p = check_picture_name(args.out_path)) return runtime::complain("hamel plot", {*p});
  const auto course = load_course({args.path, args.scene_path, args.overrides});
  if (!course) return runtime::complain("hamel plot", course.error());
  const auto kinds = panels(args, course.value());
  if (!kinds) return runtime::complain("hamel plot", {kinds.error()});
  const std::string text = Picture(course.value(), kinds.value()).script(args.out_path);
  if (const auto p = draw(text, args.out_path)) return runtime::complain("hamel plot", {*p});
  return runtime::kDone;
}

}  // namespace hamel::client
