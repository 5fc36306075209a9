#include "clients/hamel/unpacked.h"

#include <stdlib.h>

#include <filesystem>
#include <fstream>

#include "common/files/scene_text.h"

namespace hamel::client {

Unpacked::Unpacked() {
  std::string pattern = (std::filesystem::temp_directory_path() / "hamel-replay-XXXXXX").string();
  if (mkdtemp(pattern.data())) folder_ = pattern;
}

Unpacked::~Unpacked() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

bool Unpacked::add(const record::Attachment& a) {
  const std::string name = std::filesystem::path(a.name).filename().string();
  if (folder_.empty() || name.empty()) return false;
  std::ofstream out(path(name), std::ios::binary);
  out.write(a.data.data(), static_cast<std::streamsize>(a.data.size()));
  return out.good();
}

bool Unpacked::has(const std::string& name) const {
  std::error_code ignored;
  return std::filesystem::exists(path(name), ignored);
}

Checked<scene::Scene> load_scene(const Unpacked& files, const std::string& recording,
                                 const std::string& scene_path, const std::vector<std::string>& overrides) {
  if (!scene_path.empty()) return files::load_scene(scene_path, overrides);
  if (!files.has("scene.textproto"))
    return Problems{{recording, "holds no scene: it was recorded without one; name it with --scene"}};
  std::vector<std::string> all;
  if (files.has("robot.urdf")) all.push_back("robot.urdf=robot.urdf");
  for (const std::string stream : {"stream.csv", "stream.mcap"})
    if (files.has(stream)) all.push_back("perception.stream.path=" + stream);
  all.insert(all.end(), overrides.begin(), overrides.end());
  return files::load_scene(files.path("scene.textproto"), all);
}

}  // namespace hamel::client
