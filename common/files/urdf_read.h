#pragma once
/// liburdfdom, kept quiet.

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include <string>
#include <vector>

namespace hamel::files {

/// What liburdfdom made of a text, and the errors it would have printed.
struct UrdfModel {
  urdf::ModelInterfaceSharedPtr model;  ///< null when it refused
  std::vector<std::string> errors;
};

/// Parses; takes the process-wide handler of console_bridge for the time of the call (one call at a time).
UrdfModel read_urdf(const std::string& text);

}  // namespace hamel::files
