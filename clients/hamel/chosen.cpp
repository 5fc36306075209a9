#include "clients/hamel/chosen.h"

#include <optional>

#include "clients/hamel/choose.h"
#include "clients/hamel/progress.h"
#include "common/runtime/log.h"
#include "common/scene/reduce.h"

namespace hamel::client {
namespace {

/// What was chosen is in `c`; empty where the scene leaves nothing to us.
Checked<scene::Scene> load(runtime::RunOptions& o, const trade::Watch& watch, std::optional<Choosing>& c) {
  auto scene = runtime::load(o);
  if (!scene || !scene::wanted(scene.value().reduce, scene.value().reduce.step, false)) return scene;
  c = choose(scene.value(), watch);
  if (c->chosen) {
    for (std::string& set : overrides(*c->chosen)) o.overrides.push_back(std::move(set));
    // its period is chosen
    if (scene.value().reduce.cycle == scene::Choice::on) o.overrides.push_back("reduce.cycle=off");
    scene = runtime::load(o);
  }
  if (scene) apply(*c, scene.value());
  return scene;
}

}  // namespace

Checked<scene::Scene> load_chosen(runtime::RunOptions& o) {
  const std::size_t written = o.overrides.size();
  std::optional<Choosing> c;
  auto scene = [&] {
    Doing doing;
    trade::Watch watch = steady_watch();
    watch.tell = [&](const std::string& what) { doing.say(what); };
    return load(o, watch, c);
  }();
  if (!scene || !c) return scene;
  if (!c->chosen) {
    spdlog::warn("{}: nothing tried keeps every joint within {:g} over {:g} s; tier and step stay as written",
                 o.scene_path, scene.value().accuracy.joint_error_rad, c->reference.horizon_s);
    return scene;
  }
  std::string said;
  for (std::size_t k = written; k < o.overrides.size(); ++k) said += " --set " + o.overrides[k];
  spdlog::info("{}: chosen for the accuracy:{}", o.scene_path, said);
  return scene;
}

Checked<scene::Scene> load_chosen(const std::string& path, const std::vector<std::string>& overrides) {
  runtime::RunOptions o;
  o.scene_path = path;
  o.overrides = overrides;
  std::optional<Choosing> c;
  return load(o, steady_watch(), c);
}

}  // namespace hamel::client
