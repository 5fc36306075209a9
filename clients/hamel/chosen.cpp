#include "clients/hamel/chosen.h"

#include "clients/hamel/choose.h"
#include "clients/hamel/progress.h"
#include "common/runtime/log.h"
#include "common/scene/reduce.h"

namespace hamel::client {

Checked<scene::Scene> load_chosen(runtime::RunOptions& o) {
  auto scene = runtime::load(o);
  if (!scene || !scene::wanted(scene.value().reduce, scene.value().reduce.step, false)) return scene;
  const Choosing c = [&] {
    Doing doing;
    trade::Watch watch = steady_watch();
    watch.tell = [&](const std::string& what) { doing.say(what); };
    return choose(scene.value(), watch);
  }();
  if (!c.chosen) {
    apply(c, scene.value());
    spdlog::warn("{}: nothing tried keeps every joint within {:g} over {:g} s; tier and step stay as written",
                 o.scene_path, scene.value().accuracy.joint_error_rad, c.reference.horizon_s);
    return scene;
  }
  std::string said;
  std::vector<std::string> sets = overrides(*c.chosen);
  if (scene.value().reduce.cycle == scene::Choice::on) sets.push_back("reduce.cycle=off");  // it is chosen
  for (const std::string& set : sets) {
    o.overrides.push_back(set);
    said += " --set " + set;
  }
  spdlog::info("{}: chosen for the accuracy:{}", o.scene_path, said);
  scene = runtime::load(o);
  if (scene) apply(c, scene.value());
  return scene;
}

}  // namespace hamel::client
