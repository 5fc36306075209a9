/// hamel-perception: the obstacles of scenes, scripted or from a recorded stream.

#include <map>

#include "common/runtime/log.h"
#include "common/runtime/player_control.h"
#include "common/runtime/serve.h"
#include "services/perception/service.h"

using namespace hamel;
using namespace std::chrono_literals;

namespace {

/// What the command line says of the scene's stream: short for --set perception.stream.NAME=VALUE.
class StreamOptions {
 public:
  void add(CLI::App& app) {
    const auto one = [&](const char* option, const char* field, const char* help) {
      app.add_option(option, values_[field], help)->type_name("NUMBER");
    };
    one("--rate", "rate", "stream: its seconds a second of the run");
    one("--start", "start_s", "stream: its time at the start of the run");
    one("--until", "until_s", "stream: its time of the last sample");
    app.add_flag("--loop", loop_, "stream: begin anew at the end");
  }
  void put(std::vector<std::string>& overrides) const {
    for (const auto& [field, value] : values_)
      if (!value.empty()) overrides.push_back("perception.stream." + field + "=" + value);
    if (loop_) overrides.push_back("perception.stream.loop=true");
  }

 private:
  std::map<std::string, std::string> values_;
  bool loop_ = false;
};

/// The service, which obeys commands from standard input where that is asked for.
class Controlled final : public runtime::Service {
 public:
  Controlled(std::unique_ptr<perception::PerceptionService> service, bool on, bool paused)
      : owned_(std::move(service)), service_(*owned_), control_(on), on_(on) {
    if (paused) service_.pause(true);
  }
  bool poll(runtime::Clock::time_point now) override {
    bool any = service_.poll(now);
    while (const auto command = control_.next()) obey(*command), any = true;
    return any;
  }
  runtime::Clock::time_point due() const override {
    return on_ ? std::min(service_.due(), runtime::Clock::now() + 20ms) : service_.due();
  }
  bool finished() const override { return quit_; }
  int readers() const override { return service_.readers(); }
  void close() override { service_.close(); }

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
  const std::unique_ptr<perception::PerceptionService> owned_;
  perception::PerceptionService& service_;
  runtime::PlayerControl control_;
  bool on_, quit_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  using Made = Checked<std::unique_ptr<runtime::Service>>;
  StreamOptions stream;
  bool control = false, paused = false;
  const runtime::Program program{
      .name = "hamel-perception",
      .what = "publishes the obstacles of scenes on the clocks of their runs",
      .vendor = &scene::Buses::perception,
      .make = [&](bus::Node& node, const scene::Scene& scene, const runtime::RunOptions&) -> Made {
        auto made = perception::PerceptionService::make(node, scene);
        if (!made) return made.error();
        return std::unique_ptr<runtime::Service>(
            std::make_unique<Controlled>(std::move(made).value(), std::exchange(control, false), paused));
      },
      .add_options =
          [&](CLI::App& app) {
            stream.add(app);
            app.add_flag("--control", control,
                         "obey standard input: pause, resume, step, quit, or the keys space . q");
            app.add_flag("--paused", paused, "begin with the world standing still");
          },
      .adjust = [&](runtime::RunOptions& o) { stream.put(o.overrides); }};
  return runtime::serve(program, argc, argv);
}
