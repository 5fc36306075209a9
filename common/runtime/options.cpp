#include "common/runtime/options.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "common/files/scene_text.h"
#include "common/runtime/log.h"
#include "common/wire/codec.h"

namespace hamel::runtime {

namespace {

CLI::Validator number_that(const std::function<bool(double)>& holds, const std::string& rule) {
  const auto check = [=](const std::string& text) {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && holds(value);
    return good ? std::string() : text + " is not a " + rule;
  };
  return CLI::Validator(check, "", "number");
}

}  // namespace

CLI::Validator finite() {
  return number_that([](double) { return true; }, "finite number");
}

CLI::Validator positive() {
  return number_that([](double v) { return v > 0 && v <= 1e9; }, "number > 0 and <= 1e9");
}

CLI::Validator between(double low, double high) {
  return number_that([=](double v) { return v >= low && v <= high; },
                     fmt::format("number in [{:g}, {:g}]", low, high));
}

void add_bus_options(CLI::App& app, BusOptions& o) {
  app.add_option("--bus", o.vendor, "inproc, fastdds or cyclonedds")->type_name("VENDOR");
  app.add_option("--domain", o.domain, "DDS domain, 0..232")->capture_default_str();
  app.add_option("--interface", o.interface_name, "network interface or address; loopback only unless named");
  app.add_option("--peer", o.peers, "unicast address of a peer host; repeat")
      ->type_name("ADDRESS")
      ->allow_extra_args(false);
  app.add_option("--discovery-server", o.discovery_server, "of Fast DDS, instead of peers and multicast")
      ->type_name("ADDRESS:PORT");
  app.add_option("--security", o.security,
                 "folder of identities (deploy/security/make), or of one: authenticate and encrypt")
      ->type_name("DIR");
}

void add_run_options(CLI::App& app, RunOptions& o) {
  app.add_option("scene", o.scene_path, "scene file (.textproto)")->required()->type_name("SCENE");
  app.add_option("--set", o.overrides, "override a field of the scene, e.g. planner.method=gyro; repeat")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  auto* l = app.add_flag("--lockstep", o.lockstep,
                         "deterministic: each step waits for its command, as fast as it can");
  auto* r = app.add_flag("--realtime", o.realtime,
                         "paced by the clock: latest command, stale input is a named state");
  l->excludes(r);
  app.add_option("--duration", o.duration_s, "seconds of simulated time instead of the scene's")
      ->check(positive())
      ->type_name("SECONDS");
  app.add_option("--state-dir", o.state_dir, "folder of the checkpoints that a restart resumes from");
  app.add_flag("-v,--verbose", o.verbose, "log more");
  app.add_option("--priority", o.realtime_options.priority, "run under SCHED_FIFO with this priority")
      ->check(CLI::Range(1, 99));
  app.add_flag("--lock-memory", o.realtime_options.lock_memory, "keep all memory in RAM");
  app.add_option("--cpu", o.realtime_options.cpu, "run on this processor only")->check(CLI::Range(0, 1023));
  add_bus_options(app, o.bus);
}

void add_service_options(CLI::App& app, RunOptions& o) {
  app.add_option("more", o.more_scenes, "scenes of other arms, run in the same process")->type_name("SCENE");
  app.add_option("--strength", o.strength,
                 "planner: of several for one arm the strongest that is heard drives it")
      ->capture_default_str()
      ->check(CLI::Range(0u, 65535u));
  app.add_option("--readers", o.readers,
                 "begin when so many readers are there (a recorder among them), or after 5 s")
      ->check(CLI::Range(0, 1000000))
      ->type_name("N");
}

void append(const BusOptions& o, std::vector<std::string>& command) {
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) command.insert(command.end(), {name, value});
  };
  add("--bus", o.vendor);
  add("--domain", std::to_string(o.domain));
  add("--interface", o.interface_name);
  for (const auto& p : o.peers) add("--peer", p);
  add("--discovery-server", o.discovery_server);
  add("--security", o.security);
}

void append(const RealtimeOptions& o, std::vector<std::string>& command) {
  if (o.priority > 0) command.insert(command.end(), {"--priority", std::to_string(o.priority)});
  if (o.lock_memory) command.push_back("--lock-memory");
  if (o.cpu >= 0) command.insert(command.end(), {"--cpu", std::to_string(o.cpu)});
}

Checked<scene::Scene> load(const RunOptions& o) {
  auto s = files::load_scene(o.scene_path, o.overrides);
  if (!s) return s;
  if (o.duration_s > 0) s.value().duration_s = o.duration_s;
  if (s.value().duration_s / s.value().dynamics.dt_s > 1e15)
    return Problems{{o.scene_path, "duration_s / dynamics.dt_s must be at most 1e15 steps"}};
  if (s.value().duration_s < s.value().dynamics.dt_s)
    return Problems{
        {o.scene_path, fmt::format("duration_s = {:g}, must be at least one step, dynamics.dt_s = {:g}",
                                   s.value().duration_s, s.value().dynamics.dt_s)}};
  return s;
}

scene::Pace pace(const RunOptions& o, scene::Pace otherwise) {
  if (o.lockstep) return scene::Pace::lockstep;
  if (o.realtime) return scene::Pace::realtime;
  return otherwise;
}

namespace {

/// A folder of one identity as it is; of one of several (deploy/security/make) that of this program.
std::string identity_of(const std::string& folder, const std::string& name) {
  const std::filesystem::path at = folder;
  if (folder.empty() || std::filesystem::exists(at / "cert.pem")) return folder;
  for (const char* service : {"dynamics", "planner", "perception"})
    if (name == std::string("hamel-") + service) return (at / service).string();
  return (at / "client").string();
}

}  // namespace

Result<std::unique_ptr<bus::Node>, Problem> open_node(const BusOptions& o, const std::string& scene_vendor,
                                                      const std::string& name) {
  const std::string asked = !o.vendor.empty() ? o.vendor : scene_vendor;
  bus::NodeOptions n;
  n.vendor = bus::kDefaultNetworkVendor;
  if (!asked.empty()) {
    const auto vendor = bus::vendor_from(asked);
    if (!vendor) return vendor.error();
    n.vendor = vendor.value();
  }
  n.domain = o.domain;
  n.interface_name = o.interface_name;
  n.peers = o.peers;
  n.discovery_server = o.discovery_server;
  n.security = identity_of(o.security, name);
  n.name = name;
  n.awake = o.awake;
  n.log = [](const std::string& sentence) { spdlog::warn("{}", sentence); };
  return bus::open(n);
}

int complain(const std::string& program, const Problems& problems) {
  // Not fmt::print: it throws where stderr is a full disk.
  for (const auto& p : problems) std::fputs((program + ": " + to_string(p) + "\n").c_str(), stderr);
  return kBadInput;
}

std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  app.set_version_flag("--version", version());
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ParseError& e) {
    const int code = app.exit(e);
    return code == 0 ? kDone : kBadInput;
  }
}

std::string version() { return fmt::format("hamel {} (idl {})", HAMEL_VERSION, wire::idl_hash()); }

}  // namespace hamel::runtime
