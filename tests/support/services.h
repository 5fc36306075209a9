#pragma once
/// What tests of services in this process share: a node, a shipped scene, a service that must come about.

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/bus/bus.h"
#include "common/files/scene_text.h"

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

template <class T>
T made(Result<T, Problem> r) {
  if (!r) throw std::runtime_error(to_string(r.error()));
  return std::move(r).value();
}

}  // namespace hamel::test
