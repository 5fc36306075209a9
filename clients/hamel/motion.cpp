#include "clients/hamel/motion.h"

#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/runtime/options.h"

namespace hamel::client {

int on_motion(const std::string& program, const std::string& path, const std::vector<std::string>& overrides,
              const std::function<int(const scene::Scene&, const runtime::StopSignal&)>& work) {
  runtime::StopSignal stop;
  runtime::start_log("hamel", false);
  runtime::RunOptions o;
  o.scene_path = path;
  o.overrides = overrides;
  const auto scene = path.ends_with(".urdf") ? files::load_free_motion(path, overrides) : runtime::load(o);
  if (!scene) return runtime::complain(program, scene.error());
  const int code = work(scene.value(), stop);
  return stop.requested() ? runtime::kInterrupted : code;
}

}  // namespace hamel::client
