#include "common/scene/locked.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "common/scene/rules.h"

namespace hamel::scene {
namespace {

constexpr double kSame = 1e-9;  // two values of a locked joint that differ by less are one [rad or m]

using Values = std::vector<std::optional<double>>;

std::string indexed(const std::string& name, int i) {
  return std::string(name).append("[").append(std::to_string(i)).append("]");
}

int index_of(const model::Chain& chain, const std::string& name) {
  for (int i = 0; i < chain.n(); ++i)
    if (chain.joint(i).name == name) return i;
  return -1;
}

/// X_PB(q), Eq. (3).
lie::Pose pose_at(const model::Joint& joint, double q) {
  if (joint.kind == model::JointKind::prismatic)
    return joint.X_PJ * lie::Pose{Eigen::Matrix3d::Identity(), q * joint.axis};
  return joint.X_PJ * lie::Pose{Eigen::AngleAxisd(q, joint.axis).toRotationMatrix(), Eigen::Vector3d::Zero()};
}

model::Inertia seen_from(const lie::Pose& X_AB, const model::Inertia& body_B) {
  const Eigen::Matrix3d I = X_AB.R * body_B.about_com_kgm2 * X_AB.R.transpose();
  return {body_B.mass_kg, X_AB * body_B.com_m, 0.5 * (I + I.transpose())};
}

void check_lock(Rules& r, const Scene& s, const Lock& lock, std::size_t k) {
  const std::string name = indexed("locked", static_cast<int>(k)) + ".";
  const int i = index_of(s.robot.chain, lock.joint);
  if (i < 0) return r.fail(name + "joint", "= \"" + lock.joint + "\": the robot has no such joint");
  const model::JointLimits& limits = s.robot.chain.joint(i).limits;
  const double value = lock.value.value_or(s.q0[i]);
  r.must(value >= limits.lower && value <= limits.upper, name + "value", value,
         "within the limits of joint " + lock.joint);
}

/// The entries of v whose joints move.
Eigen::VectorXd moving(const Eigen::VectorXd& v, const Values& at) {
  Eigen::VectorXd out(std::count(at.begin(), at.end(), std::nullopt));
  Eigen::Index k = 0;
  for (std::size_t i = 0; i < at.size(); ++i)
    if (!at[i]) out[k++] = v[static_cast<Eigen::Index>(i)];
  return out;
}

}  // namespace

model::Inertia together(const model::Inertia& a, const model::Inertia& b) {
  const double mass = a.mass_kg + b.mass_kg;
  if (mass == 0) return {0, a.com_m, a.about_com_kgm2 + b.about_com_kgm2};
  const Eigen::Vector3d com = (a.mass_kg * a.com_m + b.mass_kg * b.com_m) / mass, r = b.com_m - a.com_m;
  const Eigen::Matrix3d apart = r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
  return {mass, com, a.about_com_kgm2 + b.about_com_kgm2 + a.mass_kg * b.mass_kg / mass * apart};
}

Values locked_values(const Scene& s) {
  Values at(static_cast<std::size_t>(s.robot.chain.n()));
  for (std::size_t i = 0; i < at.size(); ++i) {
    const model::JointLimits& limits = s.robot.chain.joint(static_cast<int>(i)).limits;
    if (limits.lower == limits.upper) at[i] = limits.lower;
  }
  for (const Lock& lock : s.locked)
    if (const int i = index_of(s.robot.chain, lock.joint); i >= 0 && i < s.q0.size())
      at[static_cast<std::size_t>(i)] = lock.value.value_or(s.q0[i]);
  return at;
}

Problems lock_problems(const Scene& s) {
  const int n = s.robot.chain.n();
  if (s.q0.size() != n || s.qd0.size() != n) return {};
  Rules r("");
  std::set<std::string> names;
  for (std::size_t k = 0; k < s.locked.size(); ++k) {
    check_lock(r, s, s.locked[k], k);
    if (!names.insert(s.locked[k].joint).second)
      r.fail(indexed("locked", static_cast<int>(k)) + ".joint",
             "= \"" + s.locked[k].joint + "\" is named twice");
  }
  const Values at = locked_values(s);
  if (std::none_of(at.begin(), at.end(), [](const auto& v) { return !v; }))
    r.fail("locked", "leaves no joint that moves");
  const bool joints = s.goal && s.goal->kind == GoalKind::joints && s.goal->joints.size() == n;
  for (int i = 0; i < n; ++i) {
    const auto& value = at[static_cast<std::size_t>(i)];
    if (!value) continue;
    const std::string where = indexed("", i), name = s.robot.chain.joint(i).name;
    if (s.q0[i] != 0 && std::abs(s.q0[i] - *value) > kSame)
      r.fail("q0" + where,
             "= " + number(s.q0[i]) + ", but joint " + name + " is locked at " + number(*value));
    if (s.qd0[i] != 0) r.fail("qd0" + where, "= " + number(s.qd0[i]) + ", but joint " + name + " is locked");
    if (joints && std::abs(s.goal->joints[i] - *value) > kSame)
      r.fail("goal.joints" + where,
             "= " + number(s.goal->joints[i]) + ", but joint " + name + " is locked at " + number(*value));
  }
  return r.take();
}

void freeze(Scene& s, const Values& at) {
  const model::ChainSpec& whole = s.robot.chain.spec();
  model::ChainSpec spec = whole;
  spec.joints.clear();
  spec.links.clear();
  std::vector<int> carrier(at.size());     // the link of the smaller arm that link i is now a part of
  std::vector<lie::Pose> X_CB(at.size());  // where it stands in that one
  lie::Pose X_CP;                          // the last link of the old arm in its carrier
  for (std::size_t i = 0; i < at.size(); ++i) {
    const model::Joint& joint = whole.joints[i];
    if (at[i]) {
      X_CP = X_CP * pose_at(joint, *at[i]);
      if (!spec.links.empty()) {
        model::Inertia& sum = spec.links.back().inertia;
        sum = together(sum, seen_from(X_CP, whole.links[i].inertia));
      }
    } else {
      spec.joints.push_back(joint);
      spec.joints.back().X_PJ = X_CP * joint.X_PJ;
      spec.links.push_back(whole.links[i]);
      X_CP = {};
    }
    carrier[i] = static_cast<int>(spec.links.size()) - 1;
    X_CB[i] = X_CP;
  }
  spec.X_NE = X_CP * whole.X_NE;
  for (LinkShape& shape : s.robot.shapes) {
    if (shape.link < 0) continue;
    const auto i = static_cast<std::size_t>(shape.link);
    shape.X_LS = X_CB[i] * shape.X_LS;
    shape.link = carrier[i];
    shape.was_link = shape.link < 0;
  }
  std::erase_if(s.robot.self_pairs, [&](const auto& pair) {
    return s.robot.shapes[pair.first].link == s.robot.shapes[pair.second].link;
  });
  s.q0 = moving(s.q0, at);
  s.qd0 = moving(s.qd0, at);
  if (s.goal && s.goal->kind == GoalKind::joints) s.goal->joints = moving(s.goal->joints, at);
  s.robot.chain = model::build(std::move(spec)).value();  // bodies put together are bodies
}

void hold(Scene& s, const Values& at) {
  model::ChainSpec spec = s.robot.chain.spec();
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!at[i]) continue;
    spec.joints[i].armature = kHeldArmature;
    s.q0[static_cast<Eigen::Index>(i)] = *at[i];
  }
  s.robot.chain = model::build(std::move(spec)).value();
}

}  // namespace hamel::scene
