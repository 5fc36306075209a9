#include "clients/hamel/course.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "clients/hamel/unpacked.h"
#include "common/files/scene_text.h"
#include "common/rbd/rbd.h"
#include "common/record/reader.h"
#include "common/wire/codec.h"
#include "services/perception/core/source.h"

namespace hamel::client {

namespace {

constexpr std::size_t kObstacleTimes = 5;

/// fmax and fmin: a NaN gives way.
void merge(Row& row, const Row& left_out) {
  row.clearance_m = std::fmin(row.clearance_m, left_out.clearance_m);
  row.iterations = std::fmax(row.iterations, left_out.iterations);
  row.planner_s = std::fmax(row.planner_s, left_out.planner_s);
  row.command_age_s = std::fmax(row.command_age_s, left_out.command_age_s);
  row.obstacle_age_s = std::fmax(row.obstacle_age_s, left_out.obstacle_age_s);
}

std::vector<Row> thinned(const std::vector<Row>& all, std::size_t most) {
  const std::size_t stride = std::max<std::size_t>(1, (all.size() + most - 1) / most);
  std::vector<Row> out;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i % stride == 0)
      out.push_back(all[i]);
    else
      merge(out.back(), all[i]);
  }
  if (stride > 1) out.push_back(all.back());
  return out;
}

/// A row of another arm than the scene's.
std::optional<Problem> foreign(const std::vector<Row>& rows, const scene::Scene& scene,
                               const std::string& path) {
  const auto n = scene.robot.chain.n();
  const auto other = std::find_if(rows.begin(), rows.end(), [n](const Row& r) { return r.q.size() != n; });
  if (other == rows.end()) return {};
  return Problem{path, fmt::format("has {} joints, the robot of {} has {}", other->q.size(), scene.name, n)};
}

/// Positions of the end effector and its distance from the target, where the scene is known.
void place_tip(Course& c) {
  if (!c.scene) return;
  const model::Chain& chain = c.scene->robot.chain;
  const auto& goal = c.scene->goal;
  const bool has_target = goal && goal->kind != scene::GoalKind::joints;
  rbd::Workspace ws(chain);
  for (Row& r : c.rows) {
    rbd::positions(chain, r.q, ws);
    r.tip_m = rbd::tip(chain, ws).p;
    if (has_target && std::isnan(r.error_m)) r.error_m = (r.tip_m - goal->X_WG.p).norm();
  }
}

// --- CSV ---------------------------------------------------------------------------------------------------

class CsvRows {
 public:
  explicit CsvRows(const std::string& path) : path_(path) {}

  Result<std::vector<Row>, Problem> read() {
    std::ifstream in(path_);
    if (!in) return Problem{path_, "cannot be read"};
    std::string line;
    std::getline(in, line);
    std::istringstream header(line);
    for (std::string name; std::getline(header, name, ',');) column_.emplace(name, column_.size());
    for (const char* name : {"t_s", "q1", "ee_x_m", "ee_z_m", "clearance_m", "energy_J", "iterations"})
      if (!column_.contains(name))
        return Problem{path_ + ":1", fmt::format("has no column {}: written by hamel run --csv?", name)};
    while (column_.contains(fmt::format("q{}", joints_ + 1))) ++joints_;
    const auto words = [&](const auto& column) {
      return words_.contains(column.second) && is_read(column.first);
    };
    std::vector<Row> rows;
    for (int number = 2; std::getline(in, line); ++number) {
      if (!cells_of(line))
        return Problem{fmt::format("{}:{}", path_, number),
                       fmt::format("has {} cells, the header {}", cells_.size(), column_.size())};
      if (const auto bad = std::find_if(column_.begin(), column_.end(), words); bad != column_.end())
        return Problem{fmt::format("{}:{}", path_, number), bad->first + " is not a number"};
      rows.push_back(row());
    }
    if (rows.empty()) return Problem{path_, "has no rows"};
    return rows;
  }

 private:
  bool cells_of(const std::string& line) {
    cells_.clear();
    words_.clear();
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) {
      char* end = nullptr;
      const double value = std::strtod(cell.c_str(), &end);
      if (end == cell.c_str() || *end != '\0') words_.insert(cells_.size());
      cells_.push_back(value);
    }
    return cells_.size() == column_.size();
  }
  static bool is_read(const std::string& name) {
    static const std::set<std::string> others{"t_s",         "ee_x_m",   "ee_y_m",    "ee_z_m",
                                              "clearance_m", "energy_J", "iterations"};
    return others.contains(name) || (name.size() > 1 && name[0] == 'q' && std::isdigit(name[1]));
  }
  double at(const char* name) const { return cells_[column_.at(name)]; }
  Row row() const {
    Row r;
    r.t_s = at("t_s");
    r.q = Eigen::Map<const Eigen::VectorXd>(cells_.data() + column_.at("q1"), joints_);
    r.tip_m = Eigen::Map<const Eigen::Vector3d>(cells_.data() + column_.at("ee_x_m"));
    r.clearance_m = at("clearance_m"), r.energy_J = at("energy_J"), r.iterations = at("iterations");
    return r;
  }

  const std::string& path_;
  std::map<std::string, std::size_t> column_;
  int joints_ = 0;
  std::vector<double> cells_;
  std::set<std::size_t> words_;  ///< cells that are no numbers
};

Checked<Course> course_of_csv(const CourseOptions& o) {
  if (o.scene_path.empty() && !o.overrides.empty())
    return Problems{{"--set " + o.overrides.front(), "changes a scene: name it with --scene"}};
  Course c;
  c.name = o.path;
  if (!o.scene_path.empty()) {
    auto scene = files::load_scene(o.scene_path, o.overrides);
    if (!scene) return scene.error();
    c.scene = std::move(scene).value();
    c.name = c.scene->name;
  }
  auto rows = CsvRows(o.path).read();
  if (!rows) return Problems{rows.error()};
  if (c.scene)
    if (const auto p = foreign(rows.value(), *c.scene, o.path)) return Problems{*p};
  c.rows = thinned(rows.value(), o.most_rows);
  place_tip(c);
  if (!c.scene) return c;
  const auto source = perception::Source::make(c.scene->perception);
  if (!source) return source.error();
  const std::size_t times = source.value().is_static() ? 1 : kObstacleTimes;
  for (std::size_t k = 0; k < times; ++k) {
    const double part = times == 1 ? 0 : static_cast<double>(k) / static_cast<double>(times - 1);
    source.value().at(part * c.rows.back().t_s, c.obstacles.emplace_back());
  }
  return c;
}

// --- MCAP --------------------------------------------------------------------------------------------------

class RecordedRows {
 public:
  explicit RecordedRows(const CourseOptions& o) : o_(o) {}

  Checked<Course> read() {
    auto reader = record::StreamReader::open(o_.path);
    if (!reader) return Problems{reader.error()};
    while (auto item = reader.value().next()) {
      if (const auto* d = std::get_if<record::Damage>(&*item))
        fmt::print(stderr, "hamel plot: {}: at byte {}: {}\n", o_.path, d->offset, d->what);
      if (const auto* c = std::get_if<record::Channel>(&*item)) topics_[c->id] = c->topic;
      if (const auto* a = std::get_if<record::Attachment>(&*item)) files_.add(*a);
      if (const auto* m = std::get_if<record::Metadata>(&*item))
        for (const auto& [key, value] : m->entries)
          if (m->name == "hamel" && key == "scene") name_ = value;
      if (const auto* m = std::get_if<record::Message>(&*item)) take(topics_[m->channel], m->data);
    }
    auto scene = load_scene(files_, o_.path, o_.scene_path, o_.overrides);
    if (!scene) return scene.error();
    Course c;
    c.scene = std::move(scene).value();
    c.name = name_.empty() ? c.scene->name : name_;
    const auto rows = rows_.find(c.scene->arm);
    if (rows == rows_.end())
      return Problems{{o_.path, fmt::format("holds no state of arm {}", c.scene->arm)}};
    const auto all = by_time(rows->second);
    if (const auto p = foreign(all, *c.scene, o_.path)) return Problems{*p};
    c.rows = thinned(all, o_.most_rows);
    place_tip(c);
    c.obstacles = some_sets();
    return c;
  }

 private:
  void take(const std::string& topic, record::View payload) {
    if (topic == topics::kState.name && wire::decode<wire::ArmState>(payload, state_)) {
      Row& r = rows_[state_.arm][state_.t_s];
      r.t_s = state_.t_s, r.q = state_.position, r.energy_J = state_.energy_J;
      r.iterations = state_.solver.iterations;
      for (std::size_t i = 0; i < state_.caused_by.size; ++i)
        if (const auto& cause = state_.caused_by.items[i]; cause.service == wire::ServiceKind::planner)
          r.command_age_s = static_cast<double>(state_.step - cause.sequence) * state_.dt_s;
    } else if (topic == topics::kReport.name && wire::decode<wire::PlannerReport>(payload, report_)) {
      Row& r = rows_[report_.arm][report_.t_s];
      r.t_s = report_.t_s;
      r.clearance_m = report_.clearance_m, r.error_m = report_.target_error_m;
      r.planner_s = report_.cycle_time_s;
      if (std::isfinite(report_.obstacle_age_s)) r.obstacle_age_s = report_.obstacle_age_s;
    } else if (topic == topics::kObstacles.name && wire::decode<wire::ObstacleSet>(payload, set_)) {
      sets_.push_back(set_);
    }
  }

  /// A report without its state has no place in space; a state without a report keeps what the last one said.
  static std::vector<Row> by_time(const std::map<double, Row>& all) {
    std::vector<Row> out;
    double clearance_m = Row::kNone, error_m = Row::kNone;
    for (const auto& [t_s, row] : all) {
      if (!std::isnan(row.error_m)) clearance_m = row.clearance_m, error_m = row.error_m;
      if (row.q.size() == 0) continue;
      out.push_back(row);
      out.back().clearance_m = clearance_m, out.back().error_m = error_m;
    }
    return out;
  }

  std::vector<std::vector<geometry::Obstacle>> some_sets() const {
    std::vector<std::vector<geometry::Obstacle>> out;
    const std::size_t times = std::min(sets_.size(), kObstacleTimes);
    for (std::size_t k = 0; k < times; ++k)
      out.push_back(sets_[times == 1 ? 0 : k * (sets_.size() - 1) / (times - 1)].obstacles);
    return out;
  }

  const CourseOptions& o_;
  Unpacked files_;
  std::string name_;
  std::map<std::uint16_t, std::string> topics_;
  std::map<std::uint32_t, std::map<double, Row>> rows_;  // by arm and time
  std::vector<wire::ObstacleSet> sets_;
  wire::ArmState state_;
  wire::PlannerReport report_;
  wire::ObstacleSet set_;
};

}  // namespace

Checked<Course> load_course(const CourseOptions& options) {
  if (options.path.ends_with(".mcap")) return RecordedRows(options).read();
  return course_of_csv(options);
}

}  // namespace hamel::client
