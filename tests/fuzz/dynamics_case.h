#pragma once
/// Any bytes as a model, options, a state and torques; and what must hold whatever they are.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/integrator.h"

namespace hamel::fuzz {

/// Reads numbers from bytes; zeros follow when they run out.  Most numbers are ordinary, some are at the
/// edge unless calm.
class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> data) : data_(data) {}
  void calm(bool yes) { calm_ = yes; }
  bool done() const { return at_ >= data_.size(); }
  unsigned byte() { return done() ? 0u : data_[at_++]; }
  int upto(int n) { return static_cast<int>(byte() % static_cast<unsigned>(n + 1)); }
  /// In [-s, s], or with the chance 1/64 something hard.
  double number(double s) {
    const unsigned kind = byte();
    if (kind < 4 && !calm_) return hard();
    const unsigned bits = byte() << 8 | byte();
    return s * (static_cast<double>(bits) / 32767.5 - 1);
  }
  /// As number(), but > 0, and over `decades` below s.
  double positive(double s, double decades) {
    const unsigned kind = byte();
    if (kind < 4 && !calm_) return hard();
    return s * std::pow(10, -decades * byte() / 255);
  }
  double hard() {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    constexpr double kHard[] = {0.0,
                                -0.0,
                                kInf,
                                -kInf,
                                std::numeric_limits<double>::quiet_NaN(),
                                5e-324,
                                1e-300,
                                1e300,
                                1e-9,
                                1e9,
                                -1e9,
                                1e6,
                                1e-6,
                                3.141592653589793,
                                -1,
                                1e154};
    return kHard[byte() % std::size(kHard)];
  }
  Eigen::Vector3d vec3(double s) {
    const double x = number(s), y = number(s), z = number(s);
    return {x, y, z};
  }
  Eigen::VectorXd vector(int n, double s) {
    Eigen::VectorXd v(n);
    for (int i = 0; i < n; ++i) v[i] = number(s);
    return v;
  }

 private:
  std::span<const std::uint8_t> data_;
  std::size_t at_ = 0;
  bool calm_ = false;
};

/// Puts a joint's motion into the plane z = 0 of the link before it.
inline void flatten(model::Joint& joint, Bytes& in) {
  const auto turn_z = [&] { return lie::exp_so3(Eigen::Vector3d(0, 0, in.number(3))); };
  joint.X_PJ.R = turn_z();
  const bool slides = joint.kind == model::JointKind::prismatic;
  joint.axis = slides ? Eigen::Vector3d(turn_z().col(0)) : Eigen::Vector3d(0, 0, in.upto(1) == 0 ? -1 : 1);
}

/// Short with numbers at the edge, or long with none; some planar.
inline model::ChainSpec spec(Bytes& in) {
  model::ChainSpec s;
  const bool calm = in.upto(1) == 0, planar = in.upto(2) == 0;
  in.calm(calm);
  s.gravity_W_mps2 = in.vec3(20);
  const int n = 1 + in.upto(calm ? 39 : 11);
  for (int i = 0; i < n; ++i) {
    model::Joint joint;
    joint.kind = static_cast<model::JointKind>(in.upto(2));
    joint.X_PJ = {lie::exp_so3(in.vec3(3)), in.vec3(1)};
    joint.axis = in.vec3(1);
    if (in.byte() > 3 || calm) joint.axis.normalize();
    if (planar) flatten(joint, in);
    if (in.upto(3) == 0) joint.damping = in.positive(10, 6);
    if (in.upto(3) == 0) joint.armature = in.positive(1, 9);
    if (in.upto(3) == 0) joint.limits.lower = -in.positive(3, 3), joint.limits.upper = in.positive(3, 3);
    if (in.upto(3) == 0) joint.limits.velocity = in.positive(10, 6);
    if (in.upto(3) == 0) joint.limits.effort = in.positive(100, 6);
    model::Link link;
    link.inertia.mass_kg = in.positive(100, calm ? 3 : 9);
    link.inertia.com_m = in.vec3(0.5);
    const double decades = calm ? 2 : 6;
    const Eigen::Array3d a =
        Eigen::Array3d(in.positive(1, decades), in.positive(1, decades), in.positive(1, decades)).square();
    const Eigen::Matrix3d R = lie::exp_so3(in.vec3(3));
    const Eigen::Vector3d moments(a[1] + a[2], a[0] + a[2], a[0] + a[1]);
    const Eigen::Matrix3d I = link.inertia.mass_kg * (R * moments.asDiagonal() * R.transpose());
    link.inertia.about_com_kgm2 = 0.5 * (I + I.transpose());
    s.joints.push_back(joint);
    s.links.push_back(link);
  }
  in.calm(false);
  return s;
}

inline dynamics::Options options(Bytes& in) {
  dynamics::Options o;
  o.tier = static_cast<scene::Tier>(in.upto(5));
  o.dt_s = in.positive(1, 7);
  o.alpha = in.number(1);
  o.stages = in.upto(9);
  o.root = static_cast<scene::Root>(in.upto(2));
  o.start = static_cast<scene::Start>(in.upto(1));
  if (in.upto(1) == 0) o.tolerance_Nm = in.positive(1, 14);
  o.tolerance_rel = in.positive(1e-2, 12);
  o.max_iterations = in.upto(40);
  o.max_subdivisions = in.upto(7);
  if (in.upto(3) == 0) o.stop_stiffness = in.positive(1e4, 6);
  o.space = static_cast<scene::Space>(in.upto(1));
  return o;
}

inline bool same(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (a[i] != b[i] && !(std::isnan(a[i]) && std::isnan(b[i]))) return false;
  return a.size() == b.size();
}

/// Now and then a wrench that may be none, a payload that may be no body, a state of other sizes.
inline std::string load(dynamics::Integrator& integrator, dynamics::State& s, Bytes& in) {
  const int n = integrator.chain().n();
  if (in.upto(2) == 0) {
    lie::Wrench F;
    F << in.vec3(5), in.vec3(20);
    if (integrator.set_wrench(in.upto(n - 1), F) != F.allFinite())
      return "a wrench that is not finite was taken, or a finite one not";
  }
  if (in.upto(3) == 0) {
    model::Inertia body{in.positive(10, 4), in.vec3(0.3), Eigen::Matrix3d::Zero()};
    const Eigen::Array3d a = Eigen::Array3d(in.number(1), in.number(1), in.number(1)).square();
    body.about_com_kgm2.diagonal() << a[1] + a[2], a[0] + a[2], a[0] + a[1];
    const dynamics::State before = s;
    const bool refused = !integrator.set_payload(body, s).empty();
    if (refused && !same(s.p, before.p)) return "a refused payload changed the state";
    if (!same(s.q, before.q) || !same(s.qd, before.qd)) return "a payload moved the arm";
  }
  if (in.upto(31) == 0) s.q.setConstant(in.upto(2 * n), 0.1);
  if (in.upto(31) == 0) s.history.assign(static_cast<std::size_t>(in.upto(200)), in.number(1));
  return {};
}

/// States between two that were good are good.
inline std::string judge_between(dynamics::Integrator& integrator, const dynamics::State& before,
                                 const dynamics::State& after, Bytes& in) {
  Eigen::VectorXd q = before.q, qd = before.qd;
  integrator.between(before, after, in.byte() / 255.0, q, qd);
  const bool small = after.q.lpNorm<Eigen::Infinity>() + before.q.lpNorm<Eigen::Infinity>() < 1e100 &&
                     after.qd.lpNorm<Eigen::Infinity>() + before.qd.lpNorm<Eigen::Infinity>() < 1e100;
  return small && !(q.allFinite() && qd.allFinite()) ? "a state inside a step is not finite" : "";
}

/// Two steps from whatever state: what a step returns is finite, what it refuses it leaves alone.
inline std::string judge_steps(const model::Chain& chain, const dynamics::Options& o, Bytes& in) {
  const int n = chain.n();
  dynamics::Integrator integrator(chain, o);
  const Eigen::VectorXd q0 = in.vector(n, 4), qd0 = in.vector(n, 5);
  dynamics::State s = integrator.start(q0, qd0);
  if (in.upto(7) == 0) s.p = in.vector(n, 10);
  if (const std::string broken = load(integrator, s, in); !broken.empty()) return broken;
  for (int k = 0; k < 2; ++k) {
    const Eigen::VectorXd tau = in.vector(n, 50);
    const dynamics::State before = s;
    const dynamics::StepReport report = integrator.step(s, tau);
    if (report.usable()) {
      if (!s.q.allFinite() || !s.p.allFinite() || !s.qd.allFinite()) return "a usable step is not finite";
      if (!std::isfinite(report.work_J) || !std::isfinite(report.energy_error_J))
        return "a report is not finite";
      if (!std::isfinite(integrator.energy(s))) return "the energy of a usable state is not finite";
      if (s.step != before.step + 1) return "a step was not counted";
      if (const std::string broken = judge_between(integrator, before, s, in); !broken.empty()) return broken;
    } else if (!same(s.q, before.q) || !same(s.p, before.p) || !same(s.qd, before.qd) ||
               s.step != before.step) {
      return "a refused step changed the state";
    }
    if (!tau.allFinite() && report.usable()) return "torque that is not finite was taken";
    const double parts = std::ldexp(2, o.max_subdivisions);
    const double most =
        o.tier == scene::Tier::dopri8 ? 2 * 5001 * 12 + parts : parts * (o.max_iterations + 2) * 16 + 64;
    if (report.evaluations > most) return "a step cost more than its budget";
  }
  return {};
}

/// The recursions take anything without a crash; what comes out of numbers at the edge may be infinite.
inline std::string judge_recursions(const model::Chain& chain, Bytes& in) {
  const int n = chain.n();
  const Eigen::VectorXd q = in.vector(n, 4), qd = in.vector(n, 5), tau = in.vector(n, 50);
  rbd::Workspace ws(chain);
  Eigen::VectorXd qdd(n), back(n);
  rbd::forward_dynamics(chain, q, qd, tau, ws, qdd);
  rbd::inverse_dynamics(chain, q, qd, qdd, ws, back);
  return {};
}

/// Empty, or what was broken.
inline std::string judge(std::span<const std::uint8_t> data) {
  Bytes in(data);
  const dynamics::Options o = options(in);
  auto chain = model::build(spec(in));
  if (!chain) return chain.error().empty() ? "refused without a reason" : "";
  if (const std::string broken = judge_recursions(chain.value(), in); !broken.empty()) return broken;
  if (!scene::problems(o).empty()) return {};
  return judge_steps(chain.value(), o, in);
}

}  // namespace hamel::fuzz
