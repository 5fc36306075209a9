#include "common/files/urdf_shapes.h"

#include <scene.pb.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/files/text_fields.h"

namespace hamel::files {
namespace {

using geometry::Shape;
using geometry::ShapeKind;

/// A solid in the link's frame.
struct Placed {
  Shape shape;
  lie::Pose X_LS;
};

bool same(double a, double b) { return std::abs(a - b) <= 1e-6 * std::max(std::abs(a), std::abs(b)) + 1e-12; }

/// The sphere of a cylinder's radius at one of its ends, or the end of the list.
std::vector<Placed>::iterator cap(std::vector<Placed>& all, const Placed& cylinder, double side) {
  const Eigen::Vector3d end = cylinder.X_LS * Eigen::Vector3d(0, 0, side * 0.5 * cylinder.shape.dims_m[1]);
  const double near = 1e-6 * (cylinder.shape.dims_m[1] + cylinder.shape.dims_m[0]) + 1e-9;
  return std::find_if(all.begin(), all.end(), [&](const Placed& p) {
    return p.shape.kind == ShapeKind::sphere && same(p.shape.dims_m[0], cylinder.shape.dims_m[0]) &&
           (p.X_LS.p - end).norm() <= near;
  });
}

/// A cylinder between two spheres of its radius is one capsule; of radius 0 it is a segment.
void merge_capsules(std::vector<Placed>& all) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].shape.kind != ShapeKind::cylinder) continue;
    const auto low = cap(all, all[i], -1), high = cap(all, all[i], 1);
    const bool both = low != all.end() && high != all.end() && low != high;
    if (!both && all[i].shape.dims_m[0] > 0) continue;
    all[i].shape.kind = ShapeKind::capsule;
    if (!both) continue;
    const auto a = std::max(low, high) - all.begin(), b = std::min(low, high) - all.begin();
    all.erase(all.begin() + a);
    all.erase(all.begin() + b);
    i -= (static_cast<std::size_t>(a) < i) + (static_cast<std::size_t>(b) < i);
  }
}

/// The shape of one <collision>; false for a mesh.
bool to_shape(const urdf::Geometry& g, Shape& out) {
  switch (g.type) {
    case urdf::Geometry::SPHERE:
      out = {ShapeKind::sphere, {static_cast<const urdf::Sphere&>(g).radius, 0, 0}};
      return true;
    case urdf::Geometry::CYLINDER: {
      const auto& c = static_cast<const urdf::Cylinder&>(g);
      out = {ShapeKind::cylinder, {c.radius, c.length, 0}};
      return true;
    }
    case urdf::Geometry::BOX: {
      const auto& d = static_cast<const urdf::Box&>(g).dim;
      out = {ShapeKind::box, {d.x, d.y, d.z}};
      return true;
    }
    case urdf::Geometry::MESH:
      break;
  }
  return false;
}

constexpr double kMeshRadius_m = 0.06;                            // where a link has no inertia
constexpr double kLeastRadius_m = 0.01, kGreatestRadius_m = 0.2;  // that an inertia is believed

/// Where the links behind this one begin, the farthest; of a last link: as far again as its centre of mass.
Eigen::Vector3d far_end(const urdf::Link& link) {
  Eigen::Vector3d end = Eigen::Vector3d::Zero();
  if (link.child_joints.empty() && link.inertial) return 2 * to_pose(link.inertial->origin).p;
  for (const urdf::JointSharedPtr& j : link.child_joints) {
    const Eigen::Vector3d p = to_pose(j->parent_to_joint_origin_transform).p;
    if (p.norm() > end.norm()) end = p;
  }
  return end;
}

bool has_inertia(const urdf::Link& link) { return link.inertial && link.inertial->mass > 0; }

/// Of the solid cylinder about the line from 0 along `axis` with the link's moment of inertia, m r^2 / 2.
double radius_from_inertia(const urdf::Link& link, const Eigen::Vector3d& axis) {
  if (!has_inertia(link)) return kMeshRadius_m;
  const urdf::Inertial& i = *link.inertial;
  Eigen::Matrix3d I;
  I << i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz;
  const lie::Pose X_LC = to_pose(i.origin);
  const Eigen::Vector3d u_C = X_LC.R.transpose() * axis;
  const double about_line = u_C.dot(I * u_C) + i.mass * X_LC.p.cross(axis).squaredNorm();
  return std::clamp(std::sqrt(std::max(2 * about_line / i.mass, 0.0)), kLeastRadius_m, kGreatestRadius_m);
}

/// What stands for a link of which only a mesh is known: a capsule from its joint to the next.
Placed fitted_capsule(const urdf::Link& link) {
  const Eigen::Vector3d end = far_end(link);
  const double length = end.norm();
  const Eigen::Vector3d axis = length > 1e-9 ? Eigen::Vector3d(end / length) : Eigen::Vector3d::UnitZ();
  Placed p;
  p.shape = {ShapeKind::capsule, {radius_from_inertia(link, axis), length, 0}};
  p.X_LS.p = 0.5 * end;
  p.X_LS.R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis).toRotationMatrix();
  return p;
}

std::string said(const Placed& capsule, bool from_inertia) {
  char text[160];
  std::snprintf(
      text, sizeof text,
      "a capsule of radius %.3g m and length %.3g m stands for it, from its joint to the next (radius: %s)",
      capsule.shape.dims_m[0], capsule.shape.dims_m[1],
      from_inertia ? "of its inertia" : "assumed, it has no inertia");
  return text;
}

}  // namespace

lie::Pose to_pose(const urdf::Pose& pose) {
  const Eigen::Quaterniond r(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  return {r.normalized().toRotationMatrix(), {pose.position.x, pose.position.y, pose.position.z}};
}

Checked<Sidecar> parse_sidecar(const std::string& text, const std::string& name) {
  text::LinkSpheres message;
  ParsedText parsed;
  parse_text(text, name, message, parsed);
  Sidecar out;
  for (int i = 0; i < message.link_size(); ++i) {
    const text::LinkSphereSet& set = message.link(i);
    const std::string path = "link[" + std::to_string(i) + "]";
    const auto fail = [&](const std::string& where, const std::string& what) {
      const TextPosition at = find_position(message, parsed.positions, where);
      parsed.problems.push_back(
          {name + ":" + std::to_string(at.line) + ":" + std::to_string(at.column), where + " " + what});
    };
    if (set.name().empty()) fail(path, "has no name");
    for (int k = 0; k < set.spheres_size(); ++k) {
      const text::LinkSphere& s = set.spheres(k);
      const std::string where = path + ".spheres[" + std::to_string(k) + "]";
      const bool center =
          s.center_m_size() == 3 && std::isfinite(s.center_m(0) + s.center_m(1) + s.center_m(2));
      if (!center) fail(where, "must have a center_m of three numbers");
      if (!s.has_radius_m() || !(s.radius_m() >= 0) || !std::isfinite(s.radius_m()))
        fail(where, "must have a radius_m >= 0");
      if (center) out[set.name()].push_back({{s.center_m(0), s.center_m(1), s.center_m(2)}, s.radius_m()});
    }
  }
  if (!parsed.problems.empty()) return std::move(parsed.problems);
  return out;
}

void append_shapes(const urdf::Link& link, int carrier, const lie::Pose& X_NL, const Sidecar& sidecar,
                   std::vector<scene::LinkShape>& shapes, std::vector<std::string>& warnings) {
  std::vector<Placed> all;
  const auto given = sidecar.find(link.name);
  int meshes = 0;
  for (const urdf::CollisionSharedPtr& c : link.collision_array) {
    Placed p;
    if (!to_shape(*c->geometry, p.shape)) {
      ++meshes;
      continue;
    }
    p.X_LS = to_pose(c->origin);
    all.push_back(p);
  }
  if (meshes > 0 && given == sidecar.end()) {
    const bool alone = all.empty();
    if (alone) all.push_back(fitted_capsule(link));
    warnings.push_back(
        "link " + link.name + ": collision mesh not read; " +
        (alone ? said(all.back(), has_inertia(link)) : std::string("its other shapes stand for it")) +
        " (give spheres in a sidecar)");
  }
  merge_capsules(all);
  if (given != sidecar.end())
    for (const SidecarSphere& s : given->second)
      all.push_back({{ShapeKind::sphere, {s.radius_m, 0, 0}}, {Eigen::Matrix3d::Identity(), s.center_m}});
  for (const Placed& p : all) shapes.push_back({carrier, p.shape, X_NL * p.X_LS});
}

}  // namespace hamel::files
