#include "common/runtime/serve.h"

#include <algorithm>
#include <set>

#include "common/runtime/log.h"
#include "common/runtime/realtime.h"
#include "common/runtime/systemd.h"

namespace hamel::runtime {

namespace {

/// Several services as one.  Each ends for itself; the others go on.
class Together final : public Service {
 public:
  explicit Together(std::vector<std::unique_ptr<Service>> all) : all_(std::move(all)) {}
  bool poll(Clock::time_point now) override {
    bool any = false;
    for (const auto& s : all_)
      if (!s->finished()) any |= s->poll(now);
    return any;
  }
  Clock::time_point due() const override {
    auto first = Clock::time_point::max();
    for (const auto& s : all_)
      if (!s->finished()) first = std::min(first, s->due());
    return first;
  }
  bool finished() const override {
    return std::all_of(all_.begin(), all_.end(), [](const auto& s) { return s->finished(); });
  }
  int exit_code() const override {
    for (const auto& s : all_)
      if (s->finished() && s->exit_code() != kDone) return s->exit_code();
    return kDone;
  }
  int readers() const override {
    int fewest = all_[0]->readers();
    for (const auto& s : all_) fewest = std::min(fewest, s->readers());
    return fewest;
  }
  void close() override {
    for (const auto& s : all_) s->close();
  }

 private:
  std::vector<std::unique_ptr<Service>> all_;
};

Checked<std::vector<scene::Scene>> load_all(const RunOptions& o) {
  std::vector<scene::Scene> scenes;
  std::set<std::uint32_t> arms;
  std::vector<std::string> paths{o.scene_path};
  paths.insert(paths.end(), o.more_scenes.begin(), o.more_scenes.end());
  for (const std::string& path : paths) {
    RunOptions one = o;
    one.scene_path = path;
    auto scene = load(one);
    if (!scene) return scene.error();
    if (!arms.insert(scene.value().arm).second)
      return Problems{
          {path, "arm " + std::to_string(scene.value().arm) + " is another scene's: one arm, one scene"}};
    scenes.push_back(std::move(scene).value());
  }
  return scenes;
}

int run_program(const Program& p, int argc, char** argv) {
  StopSignal stop;
  CLI::App app{p.name + ": " + p.what};
  RunOptions o;
  add_run_options(app, o);
  add_service_options(app, o);
  if (p.add_options) p.add_options(app);
  if (const auto code = parse(app, argc, argv)) return *code;
  start_log(p.name, o.verbose);
  if (p.adjust) p.adjust(o);

  const auto scenes = load_all(o);
  if (!scenes) return complain(p.name, scenes.error());
  // Before the middleware starts its threads, so that they inherit it.
  if (const auto problems = go_realtime(o.realtime_options); !problems.empty())
    return complain(p.name, problems);
  // In lockstep the others answer at once: asleep, a processor takes longer to wake than they to answer.
  if (pace(o, scene::Pace::realtime) == scene::Pace::lockstep) o.bus.awake = kLockstepAwake;
  auto node = open_node(o.bus, scenes.value()[0].bus.*p.vendor, p.name);
  if (!node) return complain(p.name, {node.error()});

  std::vector<std::unique_ptr<Service>> made;
  for (const scene::Scene& scene : scenes.value()) {
    auto service = p.make(*node.value(), scene, o);
    if (!service) return complain(p.name, service.error());
    made.push_back(std::move(service).value());
  }
  Together all(std::move(made));
  await_readers(*node.value(), all, o.readers, stop);
  SystemdNotifier systemd;
  Service* const services[] = {&all, &systemd};
  run(*node.value(), services, all, stop);
  linger(*node.value());
  return all.exit_code();
}

}  // namespace

int serve(const Program& program, int argc, char** argv) noexcept {
  try {
    return run_program(program, argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", program.name.c_str(), e.what());
  } catch (...) {
    std::fprintf(stderr, "%s: ended by an unknown exception\n", program.name.c_str());
  }
  return kFailed;
}

}  // namespace hamel::runtime
