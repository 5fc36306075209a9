#pragma once
/// The files that a recording carries: its scene, robot and stream.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/record/format.h"
#include "common/scene/scene.h"

namespace hamel::client {

/// On the disk for as long as they are read.
class Unpacked {
 public:
  Unpacked();
  ~Unpacked();
  Unpacked(const Unpacked&) = delete;
  Unpacked& operator=(const Unpacked&) = delete;
  bool add(const record::Attachment& a);
  bool has(const std::string& name) const;
  std::string path(const std::string& name) const { return folder_ + "/" + name; }

 private:
  std::string folder_;
};

/// The scene of the recording `recording`, or the one at `scene_path` where that is given, after `overrides`.
Checked<scene::Scene> load_scene(const Unpacked& files, const std::string& recording,
                                 const std::string& scene_path, const std::vector<std::string>& overrides);

}  // namespace hamel::client
