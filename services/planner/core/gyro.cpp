#include "services/planner/core/gyro.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "services/planner/core/force_law.h"
#include "services/planner/core/holds.h"
#include "services/planner/core/mapping.h"

namespace hamel::planner {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// How much of its press at rest a moving point presses with at most.
constexpr double kMostPress = 1.5;

Vector3d plane_axis(const model::Chain& chain) noexcept {
  Vector3d axis = Vector3d::Zero();
  Eigen::Matrix3d R_WB = chain.X_WB0().R;
  for (int i = 0; i < chain.n(); ++i) {
    if (chain.joint(i).kind == model::JointKind::prismatic) return Vector3d::Zero();
    R_WB = R_WB * chain.joint(i).X_PJ.R;
    const Vector3d a = R_WB * chain.joint(i).axis;
    if (i == 0) axis = a;
    if (axis.cross(a).norm() > 1e-9) return Vector3d::Zero();
  }
  Eigen::Index k;
  axis.cwiseAbs().maxCoeff(&k);
  return axis[k] < 0 ? Vector3d(-axis) : axis;
}

Gyro::Gyro(const Arm& arm, const scene::PlannerOptions& options)
    : options_(options),
      improved_(options.method == scene::Method::gyro),
      mapping_(improved_ ? scene::Mapping::symmetric : options.mapping),
      plane_axis_(plane_axis(arm.chain)),
      G_(Eigen::MatrixXd::Zero(arm.n(), arm.n())),
      M_minus_(Eigen::MatrixXd::Identity(arm.n(), arm.n())),
      lu_(M_minus_),
      dqd_(VectorXd::Zero(arm.n())),
      v_mid_(dqd_),
      tau_gyro_(dqd_),
      tau_moving_(dqd_) {}

// n x g where it exists (the side the attraction prefers), else what was held, else a direction fixed by
// geometry.
Vector3d Gyro::preferred_axis(const Pair& pair, const Vector3d& g, const HeldPair* held) const noexcept {
  const Vector3d across = pair.n.cross(g);
  const double size = across.norm();
  const Vector3d before = held ? vector(held->axis) : Vector3d::Zero();
  if (size > 1e-12 && size >= 1e-3 * g.norm()) {
    const Vector3d wish = across / size;
    return held && !before.isZero() && wish.dot(before) < 0.3 ? before : wish;
  }
  if (!before.isZero()) return before;
  if (!plane_axis_.isZero()) return plane_axis_;
  return pair.n.cross(geometry::least_aligned(pair.n));
}

void Gyro::choose_axes(Pairs& pairs, const Memory& memory, double t_s, const VectorXd& qdd_att) noexcept {
  const auto items = pairs.items();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    const HeldPair* held = held_pair(memory, pair.shape, pair.obstacle, t_s);
    if (pair.at.degenerate && held) pair.n = vector(held->normal);
    const Vector3d g = pairs.J(k).lazyProduct(qdd_att);
    pair.axis = turning_axis(pair.n, pair.v_relative, preferred_axis(pair, g, held));
  }
}

// w of f = w x v.
Vector3d Gyro::rotation(const Pair& pair) const noexcept {
  if (improved_) return gyro_gain(options_, scene::GainForm::S, pair.n, pair.d, pair.v_relative) * pair.axis;
  return paper_rotation(options_, pair.n, pair.d, options_.relative_velocity ? pair.v_relative : pair.v);
}

void Gyro::add(const Arm& arm, Pairs& pairs, double dt_s, VectorXd& tau) noexcept {
  if (mapping_ == scene::Mapping::paper)
    add_paper(arm, pairs, tau);
  else
    add_powerless(arm, pairs, dt_s, tau);
}

void Gyro::add_paper(const Arm& arm, Pairs& pairs, VectorXd& tau) noexcept {
  tau_gyro_.setZero();
  const auto items = pairs.items();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    pair.gyroscopic = pair.Lam * rotation(pair).cross(options_.relative_velocity ? pair.v_relative : pair.v);
    tau_gyro_.noalias() += pairs.J(k).transpose().lazyProduct(pair.gyroscopic);
  }
  gyroscopic_power_ += tau_gyro_.dot(arm.qd);
  tau += tau_gyro_;
}

// G collects the own velocities' share, tau_moving_ the obstacles'; both are of one w', so that the force
// knows relative velocity alone and does no work on what moves with the obstacle.
void Gyro::add_powerless(const Arm& arm, Pairs& pairs, double dt_s, VectorXd& tau) noexcept {
  G_.setZero();
  tau_moving_.setZero();
  bool any = false;
  const bool relative = improved_ || options_.relative_velocity;
  const auto items = pairs.items();
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    const Vector3d w = rotation(pair);
    pair.gyroscopic.setZero();
    if (w.isZero(0)) continue;
    any = true;
    const Vector3d turn = joint_rotation(mapping_, movable_inertia(pair.Lam, pair.B), w);
    pair.gyroscopic = turn;  // until v_mid is known
    add_gyroscopic(turn, pairs.J(k), G_);
    if (relative)
      tau_moving_.noalias() -= pairs.J(k).transpose().lazyProduct(Vector3d(turn.cross(pair.v_obstacle)));
  }
  if (!any) return;
  tau += tau_moving_;
  tau_gyro_.noalias() = G_ * arm.qd;
  dqd_ = dt_s * (tau - arm.coriolis + tau_gyro_);
  M_minus_ = arm.M - 0.5 * dt_s * G_;
  lu_.compute(M_minus_);
  v_mid_ = lu_.solve(dqd_);
  v_mid_ = arm.qd + 0.5 * v_mid_;
  tau_gyro_.noalias() = G_ * v_mid_;
  tau += tau_gyro_;
  gyroscopic_power_ += tau_gyro_.dot(v_mid_);
  injected_power_ += tau_moving_.dot(v_mid_);
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    if (pair.gyroscopic.isZero(0)) continue;
    const Vector3d v = pairs.J(k).lazyProduct(v_mid_);
    pair.gyroscopic = pair.gyroscopic.cross(relative ? Vector3d(v - pair.v_obstacle) : v);
  }
}

bool Gyro::add_circulation(Pairs& pairs, Memory& memory, double t_s, double kc, const VectorXd& qdd_att,
                           const VectorXd& qdd_rest, VectorXd& tau) noexcept {
  const auto items = pairs.items();
  // First contact with an obstacle: its nearest pair chooses for all links.
  for (const Pair& pair : items) {
    const HeldTurn* turn = held_turn(memory, pair.obstacle, t_s);
    if (turn) {
      remember_turn(memory, pair.obstacle, vector(turn->axis), t_s);
      continue;
    }
    const Pair* nearest = &pair;
    for (const Pair& other : items)
      if (other.obstacle == pair.obstacle && other.d < nearest->d) nearest = &other;
    remember_turn(memory, pair.obstacle, nearest->axis, t_s);
  }
  bool pressed = false;
  for (std::size_t k = 0; k < items.size(); ++k) {
    Pair& pair = items[k];
    const HeldTurn* turn = held_turn(memory, pair.obstacle, t_s);
    const double press = std::min(pair.n.dot(pairs.J(k).lazyProduct(qdd_att)),
                                  kMostPress * pair.n.dot(pairs.J(k).lazyProduct(qdd_rest)));
    if (!turn || !(press > 0)) continue;
    pressed = true;
    const double strength = kc * smooth_step(1 - pair.d / options_.rho0_m) * press;
    pair.repulsive = pair.Lam * (strength * vector(turn->axis).cross(pair.n));
    tau_gyro_.noalias() = pairs.J(k).transpose().lazyProduct(pair.repulsive);
    circulation_power_ += pair.repulsive.dot(pair.v);
    tau += tau_gyro_;
  }
  injected_power_ += circulation_power_;
  return pressed;
}

}  // namespace hamel::planner
