#include "common/model/chain.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/text.h"

namespace hamel::model {
namespace {

constexpr double kUnitTolerance = 1e-9;
/// Slack of the triangle inequality, relative to the largest principal moment: flat bodies meet it with
/// equality.
constexpr double kTriangleTolerance = 1e-6;

/// Collects problems under one place name after another.
class Check {
 public:
  explicit Check(Problems& out) : out_(out) {}
  void at(std::string where) { where_ = std::move(where); }
  void that(bool ok, const char* name, const std::string& what) {
    if (!ok) out_.push_back({where_ + "." + name, what});
  }
  /// True when every coefficient is a finite number.
  template <class M>
  bool finite(const M& m, const char* name) {
    const bool ok = m.allFinite();
    that(ok, name, "is not finite");
    return ok;
  }
  void at_least_zero(double x, const char* name) {
    that(std::isfinite(x) && x >= 0, name, "= " + text(x) + ", must be >= 0 and finite");
  }

 private:
  Problems& out_;
  std::string where_;
};

void check_pose(Check& check, const lie::Pose& X, const char* name) {
  check.finite(X.p, name);
  if (!check.finite(X.R, name)) return;
  const double error = (X.R.transpose() * X.R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  check.that(
      error <= kUnitTolerance && X.R.determinant() > 0, name,
      "rotation is not orthonormal (error " + text(error) + ", determinant " + text(X.R.determinant()) + ")");
}

void check_limits(Check& check, const JointLimits& l) {
  const auto positive = [&](double x, const char* name) {
    check.that(x > 0, name, "= " + text(x) + ", must be > 0");
  };
  check.that(l.lower <= l.upper, "limits", "lower " + text(l.lower) + " must be <= upper " + text(l.upper));
  positive(l.velocity, "limits.velocity");
  positive(l.acceleration, "limits.acceleration");
  positive(l.effort, "limits.effort");
}

void check_joint(Check& check, const Joint& j) {
  check_pose(check, j.X_PJ, "X_PJ");
  if (check.finite(j.axis, "axis")) {
    const double norm = j.axis.norm();
    check.that(std::abs(norm - 1) <= kUnitTolerance, "axis", "has length " + text(norm) + ", must be 1");
  }
  check_limits(check, j.limits);
  check.at_least_zero(j.damping, "damping");
  check.at_least_zero(j.armature, "armature");
}

/// A rotational inertia that a body can have: positive definite, no principal moment above the sum of the
/// others.
void check_about_com(Check& check, const Eigen::Matrix3d& I) {
  check.that((I - I.transpose()).cwiseAbs().maxCoeff() <= kUnitTolerance * I.cwiseAbs().maxCoeff(),
             "inertia.about_com_kgm2", "is not symmetric");
  const Eigen::Vector3d e =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(I, Eigen::EigenvaluesOnly).eigenvalues();
  const std::string moments = "principal moments " + text(e[0]) + ", " + text(e[1]) + ", " + text(e[2]);
  check.that(e[0] > 0, "inertia.about_com_kgm2", "is not positive definite: " + moments);
  check.that(e[2] <= (e[0] + e[1]) + kTriangleTolerance * e[2], "inertia.about_com_kgm2",
             "breaks the triangle inequality: " + moments);
}

void check_inertia(Check& check, const Inertia& b, double armature) {
  const bool has_com = check.finite(b.com_m, "inertia.com_m");
  check.at_least_zero(b.mass_kg, "inertia.mass_kg");
  if (!check.finite(b.about_com_kgm2, "inertia.about_com_kgm2") || !has_com) return;
  if (b.mass_kg == 0 && b.about_com_kgm2.isZero(0)) {
    check.that(armature > 0, "inertia", "a moving link needs mass and inertia (or its joint an armature)");
  } else {
    check_about_com(check, b.about_com_kgm2);
  }
}

Problems problems(const ChainSpec& spec) {
  Problems out;
  Check check(out);
  check.at(spec.name.empty() ? "chain" : spec.name);
  check.that(!spec.joints.empty(), "joints", "are none, must be at least one");
  check.that(
      spec.joints.size() == spec.links.size(), "links",
      "are " + std::to_string(spec.links.size()) + " for " + std::to_string(spec.joints.size()) + " joints");
  check_pose(check, spec.X_WB0, "X_WB0");
  check_pose(check, spec.X_NE, "X_NE");
  check.finite(spec.gravity_W_mps2, "gravity_W_mps2");
  for (std::size_t i = 0; i < spec.joints.size(); ++i) {
    const Joint& j = spec.joints[i];
    check.at("joint " + (j.name.empty() ? std::to_string(i) : j.name));
    check_joint(check, j);
    if (i >= spec.links.size()) continue;
    const Link& l = spec.links[i];
    check.at("link " + (l.name.empty() ? std::to_string(i) : l.name));
    check_inertia(check, l.inertia, j.armature);
  }
  return out;
}

}  // namespace

Chain::Chain(ChainSpec spec) : spec_(std::move(spec)) {
  A_B_.reserve(spec_.joints.size());
  for (const Joint& j : spec_.joints) {
    lie::Twist A = lie::Twist::Zero();
    if (j.kind == JointKind::prismatic) {
      A.tail<3>() = j.axis;
    } else {
      A.head<3>() = j.axis;
    }
    A_B_.push_back(A);
  }
}

Checked<Chain> build(ChainSpec spec) {
  Problems found = problems(spec);
  if (!found.empty()) return found;
  return Chain(std::move(spec));
}

Chain weightless(const Chain& chain) {
  ChainSpec spec = chain.spec();
  spec.gravity_W_mps2.setZero();
  return build(std::move(spec)).value();  // a checked chain stays valid without gravity
}

double travel_m(const Joint& joint) noexcept {
  if (joint.kind != JointKind::prismatic) return 0;
  return std::max(std::abs(joint.limits.lower), std::abs(joint.limits.upper));
}

bool slides_hold(const Chain& chain, const Eigen::VectorXd& q) noexcept {
  for (int i = 0; i < chain.n(); ++i) {
    const Joint& joint = chain.joint(i);
    if (joint.kind == JointKind::prismatic && !(std::abs(q[i]) <= travel_m(joint))) return false;
  }
  return true;
}

}  // namespace hamel::model
