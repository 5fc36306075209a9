#include "common/files/urdf.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <map>

#include "common/files/scene_text.h"
#include "common/files/urdf_lint.h"
#include "common/files/urdf_read.h"
#include "common/files/urdf_shapes.h"

namespace hamel::files {
namespace {

/// Adds the inertia of a part that stands at X_NL in link frame N.
void lump(model::Inertia& sum, const urdf::Inertial& part, const lie::Pose& X_NL) {
  const lie::Pose X_NC = X_NL * to_pose(part.origin);
  Eigen::Matrix3d I_C;
  I_C << part.ixx, part.ixy, part.ixz, part.ixy, part.iyy, part.iyz, part.ixz, part.iyz, part.izz;
  const Eigen::Matrix3d I_N = X_NC.R * I_C * X_NC.R.transpose();
  const double mass = sum.mass_kg + part.mass;
  if (mass == 0) {  // an inertia without mass has no centre
    sum.about_com_kgm2 += I_N;
    return;
  }
  // Parallel axes: the two centres turn about their common one with the reduced mass.
  const Eigen::Vector3d apart = X_NC.p - sum.com_m;
  const double reduced = sum.mass_kg * part.mass / mass;
  sum.about_com_kgm2 +=
      I_N + reduced * (apart.squaredNorm() * Eigen::Matrix3d::Identity() - apart * apart.transpose());
  sum.com_m += part.mass / mass * apart;
  sum.mass_kg = mass;
}

/// Turns a model that lint_urdf() found nothing wrong with into a chain, going down from its root.
class Builder {
 public:
  Builder(const urdf::ModelInterface& model, const UrdfLint& lint, const Sidecar& sidecar)
      : model_(model), lint_(lint), sidecar_(sidecar) {}

  Checked<scene::Robot> build(const RobotPlace& place, std::string text, std::vector<std::string> warnings) {
    warnings_ = std::move(warnings);
    spec_.name = model_.getName();
    spec_.X_WB0 = place.X_WB0;
    spec_.gravity_W_mps2 = place.gravity_W_mps2;
    add(*model_.getRoot(), -1, {});
    set_tip(place.tip);
    symmetrize();
    for (const auto& [name, spheres] : sidecar_)
      if (!model_.getLink(name)) warnings_.push_back("spheres for link " + name + ": no such link");
    warn_of_bare_links();
    auto chain = model::build(spec_);
    if (!chain) return chain.error();
    return scene::Robot{spec_.name,         std::move(text),      std::move(chain).value(),
                        std::move(shapes_), std::move(warnings_), {},
                        fixed_joints_};
  }

 private:
  /// Adds `link`, fixed at X_NL to chain link `carrier`, and all that hangs on it.
  void add(const urdf::Link& link, int carrier, const lie::Pose& X_NL) {
    if (link.inertial && carrier >= 0)
      lump(spec_.links[static_cast<std::size_t>(carrier)].inertia, *link.inertial, X_NL);
    append_shapes(link, carrier, X_NL, sidecar_, shapes_, warnings_);
    frames_[link.name] = X_NL;
    ends_[carrier] += link.child_joints.empty();
    if (link.child_joints.empty()) end_of_[carrier] = link.name;
    const urdf::Joint* moving = nullptr;
    for (const urdf::JointSharedPtr& j : link.child_joints) {
      if (j->type == urdf::Joint::FIXED) {
        ++fixed_joints_;
        add(*model_.getLink(j->child_link_name), carrier, X_NL * pose_of(*j));
      } else {
        moving = j.get();
      }
    }
    if (moving != nullptr) add_joint(*moving, X_NL);
  }

  void add_joint(const urdf::Joint& j, const lie::Pose& X_NL) {
    model::Joint joint;
    joint.name = j.name;
    joint.kind = j.type == urdf::Joint::PRISMATIC    ? model::JointKind::prismatic
                 : j.type == urdf::Joint::CONTINUOUS ? model::JointKind::continuous
                                                     : model::JointKind::revolute;
    joint.X_PJ = X_NL * pose_of(j);
    joint.axis = Eigen::Vector3d(j.axis.x, j.axis.y, j.axis.z).normalized();
    if (j.limits) set_limits(j, joint.limits);
    if (j.dynamics) joint.damping = j.dynamics->damping;
    spec_.joints.push_back(joint);
    spec_.links.push_back({j.child_link_name, {}});
    add(*model_.getLink(j.child_link_name), static_cast<int>(spec_.links.size()) - 1, {});
  }

  void set_limits(const urdf::Joint& j, model::JointLimits& out) const {
    const urdf::JointLimits& l = *j.limits;
    if (const auto a = lint_.acceleration.find(j.name); a != lint_.acceleration.end())
      out.acceleration = a->second;
    const bool none = l.effort == 0 && l.velocity == 0 &&
                      (j.type == urdf::Joint::CONTINUOUS || (l.lower == 0 && l.upper == 0));
    if (none) return;
    out.effort = l.effort;
    out.velocity = l.velocity;
    if (j.type == urdf::Joint::CONTINUOUS) return;
    out.lower = l.lower;
    out.upper = l.upper;
  }

  /// The end effector: `tip`, or the only end of what is fixed to the last link, or that link.
  void set_tip(const std::string& tip) {
    const int last = static_cast<int>(spec_.links.size()) - 1;
    const bool one_end = ends_[last] == 1;
    if (tip.empty() && !one_end)
      warnings_.push_back("end effector: " + spec_.links.back().name +
                          ", because several links are fixed to it (name one)");
    spec_.tip_name = !tip.empty() ? tip : one_end ? end_of_[last] : spec_.links.back().name;
    spec_.X_NE = frames_[spec_.tip_name];
  }

  /// Rotating an inertia leaves it symmetric but for rounding.
  void symmetrize() {
    for (model::Link& link : spec_.links) {
      const Eigen::Matrix3d I = link.inertia.about_com_kgm2;
      link.inertia.about_com_kgm2 = 0.5 * (I + I.transpose());
    }
  }

  void warn_of_bare_links() {
    for (int i = 0; i < static_cast<int>(spec_.links.size()); ++i) {
      const std::string who = "link " + spec_.links[static_cast<std::size_t>(i)].name + ":";
      const auto mine = [&](const scene::LinkShape& s) { return s.link == i; };
      const auto said = [&](const std::string& w) { return w.starts_with(who + " collision mesh"); };
      if (std::none_of(shapes_.begin(), shapes_.end(), mine) &&
          std::none_of(warnings_.begin(), warnings_.end(), said))
        warnings_.push_back(who + " no collision shape, the planner does not see it");
    }
  }

  static lie::Pose pose_of(const urdf::Joint& j) { return to_pose(j.parent_to_joint_origin_transform); }

  const urdf::ModelInterface& model_;
  const UrdfLint& lint_;
  const Sidecar& sidecar_;
  model::ChainSpec spec_;
  std::vector<scene::LinkShape> shapes_;
  std::vector<std::string> warnings_;
  int fixed_joints_ = 0;
  std::map<std::string, lie::Pose> frames_;  // of every link, in its carrier's
  std::map<int, int> ends_;                  // links without children, by carrier
  std::map<int, std::string> end_of_;        // one of them
};

/// The sidecar beside a URDF file, and its text; empty where there is none.
Checked<Sidecar> read_sidecar(const std::string& urdf_path, std::string& read) {
  std::filesystem::path path(urdf_path);
  path.replace_extension(".spheres.textproto");
  if (!std::filesystem::exists(path)) return Sidecar{};
  const auto text = read_file(path.string());
  if (!text) return text.error();
  read = text.value();
  return parse_sidecar(read, path.string());
}

Checked<scene::Robot> make(const std::string& text, const std::string& name, const RobotPlace& place,
                           const Checked<Sidecar>& sidecar) {
  UrdfLint lint = lint_urdf(text, name, place.tip);
  const UrdfModel read = read_urdf(text);
  Problems all = std::move(lint.problems);
  if (!sidecar) all.insert(all.end(), sidecar.error().begin(), sidecar.error().end());
  if (!read.model && all.empty())
    for (const std::string& e : read.errors) all.push_back({name, e});
  if (!read.model && all.empty()) all.push_back({name, "is not a URDF robot"});
  if (!all.empty()) return all;
  std::vector<std::string> warnings = std::move(lint.warnings);
  for (const std::string& e : read.errors) warnings.push_back("urdfdom: " + e);
  auto robot = Builder(*read.model, lint, sidecar.value()).build(place, text, std::move(warnings));
  if (robot) return robot;
  for (Problem p : robot.error()) all.push_back({name + ": " + p.where, p.what});
  return all;
}

}  // namespace

Checked<scene::Robot> load_urdf(const std::string& path, const RobotPlace& place) {
  const auto text = read_file(path);
  if (!text) return text.error();
  std::string spheres;
  auto robot = make(text.value(), path, place, read_sidecar(path, spheres));
  if (robot) robot.value().spheres = std::move(spheres);
  return robot;
}

Checked<scene::Robot> parse_urdf(const std::string& text, const std::string& name, const RobotPlace& place,
                                 const std::string& spheres) {
  if (spheres.empty()) return make(text, name, place, Sidecar{});
  return make(text, name, place, parse_sidecar(spheres, name + " spheres"));
}

Eigen::Matrix3d rotation_from_rpy(const Eigen::Vector3d& rpy_rad) {
  return (Eigen::AngleAxisd(rpy_rad.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy_rad.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy_rad.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace hamel::files
