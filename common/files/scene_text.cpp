#include "common/files/scene_text.h"

#include <scene.pb.h>

#include <algorithm>
#include <filesystem>

#include "common/files/scene_convert.h"
#include "common/files/stream.h"
#include "common/files/text_fields.h"
#include "common/files/urdf.h"
#include "common/rbd/planar_chain.h"
#include "common/scene/reduce.h"
#include "common/scene/self_links.h"

namespace hamel::files {
namespace {

/// A scene file on its way to a scene: the message, where its fields stand, what was wrong so far.
class Loader {
 public:
  Loader(const std::string& path, const std::vector<std::string>& overrides)
      : path_(path), overrides_(overrides) {}

  Checked<scene::Scene> load() {
    const auto text = read_file(path_);
    if (!text) return text.error();
    return load(text.value());
  }
  Checked<scene::Scene> load(const std::string& text) {
    parse_text(text, path_, message_, parsed_);
    found_ = parsed_.problems;
    if (!parsed_.complete) return std::move(found_);
    for (const std::string& o : overrides_)
      if (const std::string why = apply_override(o, message_); !why.empty())
        found_.push_back({"--set " + o, why});
    SceneParts parts = to_parts(message_);
    note(parts.missing);
    read_stream(parts);
    return assemble(std::move(parts), text);
  }

 private:
  /// Adds problems found by path, each at its place in the file or at its override.
  void note(const Problems& problems) {
    for (const Problem& p : problems) {
      const std::string what = p.where + " " + p.what;
      const auto o = std::find_if(overrides_.rbegin(), overrides_.rend(),
                                  [&](const std::string& x) { return override_touches(x, p.where); });
      const TextPosition at = find_position(message_, parsed_.positions, p.where);
      const auto is_at = [&](const TextPosition& m) { return m.line == at.line && m.column == at.column; };
      if (o != overrides_.rend())
        found_.push_back({"--set " + *o, what});
      else if (at.line == 0)
        found_.push_back({path_ + ":1:1", what});
      else if (std::none_of(parsed_.mended.begin(), parsed_.mended.end(), is_at))
        found_.push_back({path_ + ":" + std::to_string(at.line) + ":" + std::to_string(at.column), what});
    }
  }

  std::string beside(const std::string& file) const {
    return (std::filesystem::path(path_).parent_path() / file).lexically_normal().string();
  }

  void read_stream(SceneParts& parts) {
    if (!parts.perception.stream || parts.perception.stream->path.empty()) return;
    scene::Stream& s = *parts.perception.stream;
    s.path = beside(s.path);
    if (std::error_code e; !std::filesystem::exists(s.path, e))
      return note({{"perception.stream.path", "= \"" + s.path + "\": no such file"}});
    auto read = load_stream(s.path, s.topic);
    if (!read) {
      found_.insert(found_.end(), read.error().begin(), read.error().end());
      return;
    }
    s.samples = std::move(read.value().samples);
    s.empty_s = std::move(read.value().empty_s);
    if (!parts.stream_start_given) s.start_s = read.value().first_s;
  }

  std::optional<scene::Robot> read_robot(const SceneParts& parts) {
    if (message_.robot().urdf().empty()) return {};  // to_parts() has said so
    const std::string file = beside(message_.robot().urdf());
    if (!std::filesystem::exists(file)) {
      note({{"robot.urdf", "= \"" + file + "\": no such file"}});
      return {};
    }
    auto robot = load_urdf(file, parts.place);
    if (robot) return std::move(robot).value();
    found_.insert(found_.end(), robot.error().begin(), robot.error().end());
    return {};
  }

  /// Which links must not touch each other, from the scene's word and the shapes.
  void watch_links(const SceneParts& parts, scene::Robot& robot) {
    std::vector<std::pair<int, int>> allowed;
    const auto index = [&](const std::string& name) {
      for (int i = 0; i < robot.chain.n(); ++i)
        if (robot.chain.link(i).name == name) return i;
      return name == "base" ? -1 : robot.chain.n();
    };
    for (std::size_t k = 0; k < parts.allowed_contacts.size(); ++k) {
      const auto& [a, b] = parts.allowed_contacts[k];
      for (const std::string& name : {a, b})
        if (index(name) == robot.chain.n())
          note({{"robot.allowed_contact[" + std::to_string(k) + "].link",
                 "= \"" + name + "\": no such moving link, nor \"base\""}});
      allowed.emplace_back(std::min(index(a), index(b)), std::max(index(a), index(b)));
    }
    if (!parts.self_collision.value_or(!rbd::is_planar(robot.chain))) return;
    scene::watch(robot, scene::self_links(robot, allowed).watched);
  }

  /// Puts the robot to the rest and checks the rules.  Without a robot a stand-in takes its place, so that
  /// the rules that do not ask for its joints are still checked.
  Checked<scene::Scene> assemble(SceneParts parts, const std::string& file_text) {
    std::optional<scene::Robot> robot = read_robot(parts);
    const bool real = robot.has_value();
    if (!real) robot = stand_in();
    if (real) watch_links(parts, *robot);
    const Eigen::VectorXd q0 = start(parts.q0, robot->chain);
    const Eigen::VectorXd qd0 = parts.qd0.value_or(Eigen::VectorXd::Zero(robot->chain.n()));
    scene::Scene s{parts.name,
                   text_of(file_text),
                   parts.arm,
                   std::move(*robot),
                   q0,
                   qd0,
                   parts.goal,
                   parts.steered,
                   parts.dynamics,
                   parts.planner,
                   std::move(parts.perception),
                   parts.bus,
                   parts.duration_s,
                   parts.stop,
                   parts.reduce,
                   parts.accuracy,
                   std::move(parts.locked)};
    if (s.name.empty()) s.name = std::filesystem::path(path_).stem().string();
    Problems broken = scene::problems(s);
    std::erase_if(broken, [&](const Problem& p) { return is_said(p.where, s, real); });
    note(broken);
    if (!found_.empty()) return std::move(found_);
    return s;
  }

  /// True for a consequence of a problem that was already noted.
  static bool is_said(const std::string& path, const scene::Scene& s, bool real_robot) {
    if (path == "perception.stream.path")
      return s.perception.stream->samples.empty() && s.perception.stream->empty_s.empty();
    const bool of_joints = path.starts_with("q0") || path.starts_with("qd0") ||
                           path.starts_with("goal.joints") || path.starts_with("locked") ||
                           path == "planner.kc";
    return of_joints && !real_robot;
  }

  static scene::Robot stand_in() {
    model::ChainSpec spec;
    spec.joints.resize(1);
    spec.links.push_back({"link", {1, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()}});
    return scene::Robot{"", "", model::build(spec).value(), {}, {}};
  }

  /// Zero, or the limit nearest to it.
  static Eigen::VectorXd start(const std::optional<Eigen::VectorXd>& q0, const model::Chain& chain) {
    if (q0) return *q0;
    Eigen::VectorXd q(chain.n());
    for (int i = 0; i < chain.n(); ++i)
      q[i] = std::clamp(0.0, chain.joint(i).limits.lower, chain.joint(i).limits.upper);
    return q;
  }

  std::string text_of(const std::string& file_text) const {
    if (overrides_.empty()) return file_text;
    std::string out;
    google::protobuf::TextFormat::PrintToString(message_, &out);
    return out;
  }

  const std::string& path_;
  const std::vector<std::string>& overrides_;
  text::Scene message_;
  ParsedText parsed_;
  Problems found_;
};

}  // namespace

Checked<scene::Scene> read_scene(const std::string& path, const std::vector<std::string>& overrides) {
  return Loader(path, overrides).load();
}

Checked<scene::Scene> load_scene(const std::string& path, const std::vector<std::string>& overrides) {
  auto scene = read_scene(path, overrides);
  if (scene) scene::reduce(scene.value());
  return scene;
}

Problems set_planner(const std::vector<std::string>& assignments, scene::PlannerOptions& options) {
  text::Planner message;
  Problems found;
  for (const std::string& a : assignments)
    if (const std::string why = apply_override(a, message); !why.empty()) found.push_back({a, why});
  const Problems bad = to_options(message, options);
  found.insert(found.end(), bad.begin(), bad.end());
  const Problems broken = scene::problems(options);
  found.insert(found.end(), broken.begin(), broken.end());
  return found;
}

Checked<scene::Scene> load_free_motion(const std::string& urdf_path,
                                       const std::vector<std::string>& overrides) {
  const auto robot = load_urdf(urdf_path);
  if (!robot) return robot.error();
  const model::Chain& chain = robot.value().chain;
  std::string q0, file;
  for (int i = 0; i < chain.n(); ++i) {
    const model::JointLimits& limits = chain.joint(i).limits;
    q0 += (i ? ", " : "") + std::to_string(std::clamp(0.5, limits.lower, limits.upper));
  }
  for (const char c : std::filesystem::path(urdf_path).filename().string()) {
    if (c == '"' || c == '\\') file += '\\';
    file += c;
  }
  return Loader(urdf_path, overrides)
      .load("robot { urdf: \"" + file + "\" } q0: [" + q0 + "] steered: false stop: at_duration");
}

}  // namespace hamel::files
