#pragma once
/// What tests of services in this process share: a node, a shipped scene, messages, a service that must come
/// about.

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/bus/bus.h"
#include "common/files/scene_text.h"
#include "common/wire/messages.h"

namespace hamel::test {

/// A node of the in-process bus.
inline std::unique_ptr<bus::Node> node(std::uint32_t domain) {
  bus::NodeOptions o;
  o.domain = domain;
  return std::move(bus::open(o)).value();
}

/// deploy/scenes/NAME.textproto.
inline scene::Scene shipped(const std::string& name, const std::vector<std::string>& overrides = {}) {
  auto s =
      files::load_scene(std::string(HAMEL_SOURCE_DIR) + "/deploy/scenes/" + name + ".textproto", overrides);
  if (!s) throw std::runtime_error(to_string(s.error()[0]));
  return std::move(s).value();
}

/// Example 5.2 as shipped.
inline scene::Scene four_link(const std::vector<std::string>& overrides = {}) {
  return shipped("four_link_avoid", overrides);
}

/// What an arm at rest at `q` says of itself after `step` steps of 1 ms.
inline wire::ArmState arm_state(std::uint64_t step, const Eigen::VectorXd& q, std::uint32_t arm = 1,
                                std::uint64_t incarnation = 1) {
  wire::ArmState m;
  m.arm = arm;
  m.incarnation = incarnation;
  m.step = step;
  m.dt_s = 1e-3;
  m.t_s = 1e-3 * static_cast<double>(step);
  m.position = q;
  m.velocity = m.momentum = m.torque_applied = wire::JointVector::Zero(q.size());
  return m;
}

/// A planner's answer to it: so much torque on the first joint.
inline wire::TorqueCommand answer_to(const wire::ArmState& state, double torque_Nm, std::uint64_t epoch = 1) {
  wire::TorqueCommand c;
  c.arm = state.arm;
  c.epoch = epoch;
  c.state_incarnation = state.incarnation;
  c.step = state.step;
  c.t_s = state.t_s;
  c.torque = wire::JointVector::Zero(state.position.size());
  c.torque[0] = torque_Nm;
  return c;
}

template <class T>
T made(Result<T, Problem> r) {
  if (!r) throw std::runtime_error(to_string(r.error()));
  return std::move(r).value();
}

}  // namespace hamel::test
