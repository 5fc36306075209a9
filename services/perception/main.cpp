/// hamel-perception: publishes the obstacles of a scene, scripted or from a recorded stream.

#include <map>

#include "common/runtime/log.h"
#include "common/runtime/options.h"
#include "common/runtime/player_control.h"
#include "services/perception/service.h"

using namespace hamel;
using namespace std::chrono_literals;

namespace {

/// What the command line says of the scene's stream: short for --set perception.stream.NAME=VALUE.
class StreamOptions {
 public:
  explicit StreamOptions(CLI::App& app) {
    const auto add = [&](const char* option, const char* field, const char* help) {
      app.add_option(option, values_[field], help)->type_name("NUMBER");
    };
    add("--rate", "rate", "stream: its seconds a second of the run");
    add("--start", "start_s", "stream: its time at the start of the run");
    add("--until", "until_s", "stream: its time of the last sample");
    app.add_flag("--loop", loop_, "stream: begin anew at the end");
  }
  StreamOptions(const StreamOptions&) = delete;
  StreamOptions& operator=(const StreamOptions&) = delete;
  void put(std::vector<std::string>& overrides) const {
    for (const auto& [field, value] : values_)
      if (!value.empty()) overrides.push_back("perception.stream." + field + "=" + value);
    if (loop_) overrides.push_back("perception.stream.loop=true");
  }

 private:
  std::map<std::string, std::string> values_;
  bool loop_ = false;
};

/// Commands from standard input to the service.
class Controlled final : public runtime::Service {
 public:
  Controlled(perception::PerceptionService& service, bool on, bool paused)
      : service_(service), control_(on), on_(on) {
    if (paused) service_.pause(true);
  }
  bool poll(runtime::Clock::time_point) override {
    bool any = false;
    while (const auto command = control_.next()) obey(*command), any = true;
    return any;
  }
  runtime::Clock::time_point due() const override { return runtime::Clock::now() + (on_ ? 20ms : 1000ms); }
  bool finished() const override { return quit_; }

 private:
  void obey(runtime::PlayerCommand command) {
    using C = runtime::PlayerCommand;
    quit_ |= command == C::quit;
    if (quit_) return;
    if (command == C::step) service_.pause(true), service_.step();
    if (command == C::pause || command == C::resume || command == C::toggle)
      service_.pause(command == C::toggle ? !service_.paused() : command == C::pause);
    spdlog::info("{} at {:.3f} s", service_.paused() ? "stands" : "goes on", service_.shown_s());
  }
  perception::PerceptionService& service_;
  runtime::PlayerControl control_;
  bool on_, quit_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  runtime::StopSignal stop;
  CLI::App app{"hamel-perception: publishes the obstacles of a scene on the run's clock"};
  runtime::RunOptions o;
  bool control = false, paused = false;
  runtime::add_run_options(app, o);
  runtime::add_readers_option(app, o);
  const StreamOptions stream(app);
  app.add_flag("--control", control, "obey standard input: pause, resume, step, quit, or the keys space . q");
  app.add_flag("--paused", paused, "begin with the world standing still");
  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  runtime::start_log("hamel-perception", o.verbose);
  stream.put(o.overrides);

  const auto scene = runtime::load(o);
  if (!scene) return runtime::complain("hamel-perception", scene.error());
  auto node = runtime::open_node(o.bus, scene.value().bus.perception, "hamel-perception");
  if (!node) return runtime::complain("hamel-perception", {node.error()});

  auto service = perception::PerceptionService::make(*node.value(), scene.value());
  if (!service) return runtime::complain("hamel-perception", service.error());
  runtime::await_readers(*node.value(), *service.value(), o.readers, stop);
  Controlled controlled(*service.value(), control, paused);
  runtime::Service* const services[] = {service.value().get(), &controlled};
  runtime::run(*node.value(), services, controlled, stop);
  return runtime::kDone;
}
