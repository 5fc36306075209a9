#pragma once
/// The scenes that come with the program.

#include <filesystem>
#include <string>

namespace hamel::client {

/// The file of a shipped scene, installed or beside the build; empty where it is not there.
inline std::string shipped_scene(const std::string& name) {
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  for (const char* at : {"../share/hamel/scenes", "../../../deploy/scenes"})
    if (const auto p = here / at / (name + ".textproto"); std::filesystem::exists(p)) return p.string();
  return "";
}

}  // namespace hamel::client
