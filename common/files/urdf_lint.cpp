#include "common/files/urdf_lint.h"

#include <tinyxml2.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "common/files/urdf_structure.h"
#include "common/scene/rules.h"

namespace hamel::files {
namespace {

using scene::number;
using tinyxml2::XMLElement;

constexpr double kAxisUnit = 1e-3;   // a written axis may be rounded; it is made unit afterwards
constexpr double kDefinite = 1e-12;  // smallest over largest principal moment
constexpr double kTriangle = 1e-9;   // of the largest principal moment, for rounded figures

std::optional<double> to_number(std::string_view text) {
  while (!text.empty() && std::string_view(" \t\r\n").find(text.front()) != std::string_view::npos)
    text.remove_prefix(1);
  while (!text.empty() && std::string_view(" \t\r\n").find(text.back()) != std::string_view::npos)
    text.remove_suffix(1);
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double v = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(v)) return {};
  return v;
}

/// Checks one <link> or <joint> and notes what is wrong under its name.
class Part {
 public:
  Part(const XMLElement& element, const std::string& file, UrdfLint& out)
      : element_(element), file_(file), out_(out), name_(attribute(element, "name")) {
    title_ = std::string(element.Name()) + " " + (name_.empty() ? "(no name)" : name_);
    if (name_.empty()) fail(element, "has no name");
  }

  const std::string& name() const { return name_; }

  static std::string attribute(const XMLElement& e, const char* name) {
    const char* text = e.Attribute(name);
    return text == nullptr ? "" : text;
  }

  void fail(const XMLElement& at, const std::string& what) {
    out_.problems.push_back({file_ + ":" + std::to_string(at.GetLineNum()) + ": " + title_, what});
  }
  void warn(const std::string& what) { out_.warnings.push_back(title_ + ": " + what); }

  /// A number that must stand there.
  std::optional<double> required(const XMLElement& e, const char* name) {
    if (e.Attribute(name) == nullptr) {
      fail(e, std::string(e.Name()) + " has no " + name);
      return {};
    }
    return read(e, name);
  }

  /// A number or its default; nothing when it is there and bad.
  std::optional<double> optional(const XMLElement& e, const char* name, double otherwise) {
    return e.Attribute(name) == nullptr ? std::optional(otherwise) : read(e, name);
  }

  /// Three numbers or their default.
  std::optional<Eigen::Vector3d> triple(const XMLElement& e, const char* name,
                                        const Eigen::Vector3d& otherwise) {
    if (e.Attribute(name) == nullptr) return otherwise;
    const std::string text = attribute(e, name);
    Eigen::Vector3d v;
    int count = 0;
    for (std::size_t begin = text.find_first_not_of(" \t\r\n"); begin != std::string::npos; ++count) {
      const std::size_t end = std::min(text.find_first_of(" \t\r\n", begin), text.size());
      const auto x = to_number(std::string_view(text).substr(begin, end - begin));
      if (!x)
        return fail(e, std::string(e.Name()) + " " + name + " = \"" + text + "\", must be finite numbers"),
               std::nullopt;
      if (count < 3) v[count] = *x;
      begin = text.find_first_not_of(" \t\r\n", end);
    }
    if (count == 3) return v;
    fail(e, std::string(e.Name()) + " " + name + " = \"" + text + "\", must be three numbers");
    return {};
  }

  void origin_of(const XMLElement& parent) {
    const XMLElement* origin = parent.FirstChildElement("origin");
    if (origin == nullptr) return;
    triple(*origin, "xyz", Eigen::Vector3d::Zero());
    triple(*origin, "rpy", Eigen::Vector3d::Zero());
    if (origin->Attribute("quat_xyzw") != nullptr) fail(*origin, "origin has quat_xyzw, must use rpy");
  }

 protected:
  std::optional<double> read(const XMLElement& e, const char* name) {
    const auto v = to_number(e.Attribute(name));
    if (!v)
      fail(e,
           std::string(e.Name()) + " " + name + " = \"" + e.Attribute(name) + "\", must be a finite number");
    return v;
  }

  const XMLElement& element_;
  const std::string& file_;
  UrdfLint& out_;
  std::string name_, title_;
};

class LinkPart : public Part {
 public:
  using Part::Part;

  /// True when the link says it has mass or inertia (right or wrong).
  bool check() {
    bool heavy = false;
    if (const XMLElement* inertial = element_.FirstChildElement("inertial")) {
      if (inertial->NextSiblingElement("inertial") != nullptr) fail(*inertial, "has more than one inertial");
      heavy = check_inertial(*inertial);
    }
    for (const XMLElement* c = element_.FirstChildElement("collision"); c != nullptr;
         c = c->NextSiblingElement("collision"))
      check_collision(*c);
    return heavy;
  }

 private:
  bool check_inertial(const XMLElement& inertial) {
    origin_of(inertial);
    const XMLElement* mass = inertial.FirstChildElement("mass");
    const XMLElement* inertia = inertial.FirstChildElement("inertia");
    if (mass == nullptr) fail(inertial, "inertial has no mass");
    if (inertia == nullptr) fail(inertial, "inertial has no inertia");
    const auto mass_kg = mass == nullptr ? std::nullopt : required(*mass, "value");
    const double m = mass_kg.value_or(0);
    if (m < 0) fail(*mass, "mass = " + number(m) + " kg, must be >= 0");
    if (inertia == nullptr) return true;
    Eigen::Matrix3d I;
    const char* names[3][3] = {{"ixx", "ixy", "ixz"}, {"ixy", "iyy", "iyz"}, {"ixz", "iyz", "izz"}};
    bool read_all = true;
    for (int r = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c) {
        const auto v = required(*inertia, names[r][c]);
        read_all = read_all && v;
        I(r, c) = I(c, r) = v.value_or(0);
      }
    if (mass_kg && m >= 0 && read_all) check_physics(*inertia, m, I);
    return !mass_kg || !read_all || m != 0 || !I.isZero(0);
  }

  void check_physics(const XMLElement& at, double mass_kg, const Eigen::Matrix3d& I) {
    if (I.isZero(0)) {
      if (mass_kg > 0)
        fail(at, "zero inertia with mass " + number(mass_kg) + " kg, must be positive definite");
      return;
    }
    const Eigen::Vector3d moments =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(I, Eigen::EigenvaluesOnly).eigenvalues();
    const std::string principal = "principal moments " + number(moments[0]) + ", " + number(moments[1]) +
                                  ", " + number(moments[2]) + " kg m^2";
    if (!(moments[0] > kDefinite * moments[2]))
      fail(at, "inertia is not positive definite: " + principal);
    else if (moments[0] + moments[1] < moments[2] * (1 - kTriangle))
      fail(at, "inertia breaks the triangle inequality: " + principal);
    else if (mass_kg == 0)
      warn("mass 0 with an inertia: lumped as it stands");
  }

  void check_collision(const XMLElement& collision) {
    origin_of(collision);
    const XMLElement* geometry = collision.FirstChildElement("geometry");
    const XMLElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
    if (shape == nullptr) return fail(collision, "collision has no geometry");
    const std::string_view kind = shape->Name();
    const auto size = [&](const char* name) {
      const auto v = required(*shape, name);
      if (v && *v < 0) fail(*shape, std::string(kind) + " " + name + " = " + number(*v) + ", must be >= 0");
    };
    if (kind == "sphere" || kind == "cylinder") size("radius");
    if (kind == "cylinder") size("length");
    if (kind == "box") {
      if (shape->Attribute("size") == nullptr) return fail(*shape, "box has no size");
      const auto edges = triple(*shape, "size", Eigen::Vector3d::Ones());
      if (edges && !(edges->array() > 0).all()) fail(*shape, "box has an edge that is not > 0");
    }
    if (kind != "sphere" && kind != "cylinder" && kind != "box" && kind != "mesh")
      fail(*shape,
           "collision shape " + std::string(kind) + " is not supported: sphere, box, cylinder or mesh");
  }
};

class JointPart : public Part {
 public:
  using Part::Part;

  UrdfJoint check() {
    const std::string type = attribute(element_, "type");
    const UrdfJoint joint{name_, link_of("parent"), link_of("child"), type != "fixed", element_.GetLineNum()};
    origin_of(element_);
    if (type == "fixed") return joint;
    if (type != "revolute" && type != "continuous" && type != "prismatic") {
      fail(element_, type.empty() ? "has no type"
                                  : "joint type " + type +
                                        " is not supported: revolute, continuous, prismatic or fixed");
      return joint;
    }
    if (const XMLElement* mimic = element_.FirstChildElement("mimic"))
      fail(*mimic, "mimic joints are not supported (it follows " + attribute(*mimic, "joint") + ")");
    check_axis();
    check_limit(type);
    check_dynamics();
    return joint;
  }

 private:
  std::string link_of(const char* role) {
    const XMLElement* e = element_.FirstChildElement(role);
    const std::string link = e == nullptr ? "" : attribute(*e, "link");
    if (link.empty()) fail(element_, std::string("has no ") + role + " link");
    return link;
  }

  void check_axis() {
    const XMLElement* axis = element_.FirstChildElement("axis");
    if (axis == nullptr) return warn("no axis: x is taken, as URDF says");
    if (axis->Attribute("xyz") == nullptr) return fail(*axis, "axis has no xyz");
    const auto v = triple(*axis, "xyz", Eigen::Vector3d::UnitX());
    if (v && std::abs(v->norm() - 1) > kAxisUnit)
      fail(*axis, "axis has length " + number(v->norm()) + ", must be a unit vector");
  }

  void check_limit(const std::string& type) {
    const XMLElement* limit = element_.FirstChildElement("limit");
    if (limit == nullptr) {
      if (type != "continuous")
        fail(element_, "has no limit, a " + type + " joint needs lower, upper, effort and velocity");
      return;
    }
    for (const char* key : {"acceleration", "drake:acceleration"})
      if (limit->Attribute(key) != nullptr) {
        const auto a = read(*limit, key);
        if (a && !(*a > 0)) fail(*limit, std::string(key) + " = " + number(*a) + ", must be > 0");
        if (a) out_.acceleration[name_] = *a;
      }
    const auto effort = required(*limit, "effort"), velocity = required(*limit, "velocity");
    if (effort && *effort < 0) fail(*limit, "effort limit = " + number(*effort) + ", must be >= 0");
    if (velocity && *velocity < 0) fail(*limit, "velocity limit = " + number(*velocity) + ", must be >= 0");
    if (type == "continuous" || !effort || !velocity) return;
    check_range(*limit, type, *effort == 0 && *velocity == 0);
  }

  void check_range(const XMLElement& limit, const std::string& type, bool others_zero) {
    const auto lower = optional(limit, "lower", 0), upper = optional(limit, "upper", 0);
    if (!lower || !upper) return;
    const bool absent = limit.Attribute("lower") == nullptr && limit.Attribute("upper") == nullptr;
    if (*lower > *upper)
      fail(limit, "limits crossed: lower " + number(*lower) + " > upper " + number(*upper));
    else if (*lower == 0 && *upper == 0 && others_zero)
      warn("all limits are 0: taken as none given");
    else if (absent)
      fail(limit, "limit has neither lower nor upper, a " + type + " joint needs them");
    else if (*lower == *upper)
      warn("lower and upper limit are equal: the joint may not move");
  }

  void check_dynamics() {
    const XMLElement* dynamics = element_.FirstChildElement("dynamics");
    if (dynamics == nullptr) return;
    const auto damping = optional(*dynamics, "damping", 0), friction = optional(*dynamics, "friction", 0);
    if (damping && *damping < 0) fail(*dynamics, "damping = " + number(*damping) + ", must be >= 0");
    if (friction && *friction < 0) fail(*dynamics, "friction = " + number(*friction) + ", must be >= 0");
    if (friction && *friction > 0) warn("dry friction " + number(*friction) + " is not modelled: left out");
  }
};

}  // namespace

UrdfLint lint_urdf(const std::string& text, const std::string& name, const std::string& tip) {
  UrdfLint out;
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    out.problems.push_back({name + ":" + std::to_string(document.ErrorLineNum()), "is not well-formed XML"});
    return out;
  }
  const XMLElement* robot = document.FirstChildElement("robot");
  if (robot == nullptr) {
    out.problems.push_back({name + ":1", "has no <robot> element"});
    return out;
  }
  UrdfStructure structure;
  for (const XMLElement* e = robot->FirstChildElement("link"); e != nullptr;
       e = e->NextSiblingElement("link")) {
    LinkPart link(*e, name, out);
    const bool heavy = link.check();
    if (!structure.links.emplace(link.name(), UrdfLink{heavy, e->GetLineNum()}).second)
      link.fail(*e, "is there twice");
  }
  for (const XMLElement* e = robot->FirstChildElement("joint"); e != nullptr;
       e = e->NextSiblingElement("joint")) {
    JointPart joint(*e, name, out);
    for (const UrdfJoint& other : structure.joints)
      if (other.name == joint.name()) joint.fail(*e, "is there twice");
    structure.joints.push_back(joint.check());
  }
  scene::append(out.problems, check_structure(structure, name, tip));
  return out;
}

}  // namespace hamel::files
