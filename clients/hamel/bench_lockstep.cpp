#include "clients/hamel/bench_lockstep.h"

#include <fcntl.h>

#include <filesystem>

#include "clients/hamel/bench_ping.h"
#include "clients/hamel/ticks.h"
#include "common/files/scene_text.h"
#include "common/runtime/serve.h"
#include "services/perception/service.h"
#include "services/planner/service.h"

namespace hamel::client {

using namespace ping;

namespace {

constexpr std::uint64_t kFirst = 2000, kLast = 22000;  // steps between which a run is timed
constexpr auto kPatience = 120s;

/// A service as a process of its own, in lockstep to the end of what is timed.
Child service(const std::string& name, Vendor vendor, std::uint32_t domain, const std::string& scene_path) {
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::vector<std::string> words{(here / ("hamel-" + name)).string(),
                                 scene_path,
                                 "--lockstep",
                                 "--set",
                                 "stop=at_duration",
                                 "--duration",
                                 "60",
                                 "--bus",
                                 to_string(vendor),
                                 "--domain",
                                 std::to_string(domain)};
  return Child([words]() mutable {
    std::vector<char*> argv;
    for (auto& w : words) argv.push_back(w.data());
    argv.push_back(nullptr);
    const int null = ::open("/dev/null", O_WRONLY);
    dup2(null, STDOUT_FILENO);
    dup2(null, STDERR_FILENO);
    execv(argv[0], argv.data());
  });
}

/// Wall time of a step, by the clock of the run; `work` is what this process does for it.
template <class Work>
double step_us(bus::Node& node, Work work) {
  wire::Subscription<wire::SimulationClock> clocks(node);
  wire::SimulationClock c;
  Clock::time_point from{};
  std::uint64_t first = 0;
  for (const auto limit = Clock::now() + kPatience; Clock::now() < limit;) {
    const bool worked = work(Clock::now());
    while (clocks.take(c)) {
      if (first == 0 && c.step >= kFirst) first = c.step, from = Clock::now();
      if (c.step >= kLast)
        return std::chrono::duration<double, std::micro>(Clock::now() - from).count() /
               static_cast<double>(c.step - first);
    }
    if (!worked) node.wait(Clock::now() + 10ms);
  }
  throw std::runtime_error("lockstep over " + std::string(to_string(node.options().vendor)) +
                           " stands still");
}

double in_three(Vendor vendor, std::uint32_t domain, const std::string& scene_path) {
  const auto node = ping::open(vendor, domain);
  const Child planner = service("planner", vendor, domain, scene_path);
  const Child perception = service("perception", vendor, domain, scene_path);
  const Child dynamics = service("dynamics", vendor, domain, scene_path);
  return step_us(*node, [](Clock::time_point) { return false; });
}

double in_two(Vendor vendor, std::uint32_t domain, const std::string& scene_path, const scene::Scene& scene) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = domain;
  options.awake = runtime::kLockstepAwake;
  auto node = bus::open(options);
  if (!node) throw std::runtime_error(to_string(node.error()));
  auto eyes = perception::PerceptionService::make(*node.value(), scene);
  auto brain = planner::PlannerService::make(*node.value(), scene, {.pace = scene::Pace::lockstep});
  if (!eyes || !brain) throw std::runtime_error("lockstep: the services cannot be made");
  const Child dynamics = service("dynamics", vendor, domain, scene_path);
  return step_us(*node.value(), [&](Clock::time_point now) {
    const bool seen = eyes.value()->poll(now), planned = brain.value()->poll(now);
    return seen || planned;
  });
}

double ticks_us(const scene::Scene& scene) {
  Ticks ticks(scene);
  const auto began = Clock::now();
  for (std::uint64_t k = 0; k < kLast; ++k) {
    ticks.plan();
    if (!ticks.step()) break;
  }
  return std::chrono::duration<double, std::micro>(Clock::now() - began).count() / static_cast<double>(kLast);
}

}  // namespace

LockstepRate lockstep_rate(Vendor vendor, std::uint32_t domain, const std::string& scene_path, int processes,
                           const std::function<double()>& udp_round_us) {
  const auto scene = files::load_scene(scene_path, {"stop=at_duration", "duration_s=60"});
  if (!scene) throw std::runtime_error(to_string(scene.error()[0]));
  LockstepRate r{.processes = processes, .tick_us = ticks_us(scene.value())};
  const double before = udp_round_us();
  r.step_us = processes == 2 ? in_two(vendor, domain, scene_path, scene.value())
                             : in_three(vendor, domain, scene_path);
  r.udp_round_us = 0.5 * (before + udp_round_us());
  return r;
}

}  // namespace hamel::client
