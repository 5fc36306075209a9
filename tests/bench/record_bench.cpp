/// What recording costs: `hamel record` beside 1 kHz of states, commands and reports, a clock of 100 Hz and
/// obstacle sets of 30 Hz, those of a Panda among eight obstacles.
///
///   hamel_record_bench HAMEL [seconds [compression]]
///
/// HAMEL is the program.  For each vendor: processor time of the recorder from the first message to the last,
/// as a part of one core, and how many of the messages are in the file.  Exit code 1 where that is a tenth of
/// a core or more, or one is missing.

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <thread>

#include "common/record/reader.h"
#include "common/wire/endpoint.h"

namespace {

using namespace hamel;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kDomain = 98;
constexpr int kJoints = 7, kObstacles = 8;

/// Processor time of a process so far [s].
double processor_s(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/stat");
  std::string word;
  double ticks = 0;
  for (int i = 1; i <= 15 && in >> word; ++i)
    if (i >= 14) ticks += std::stod(word);
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

pid_t start_recorder(const char* hamel, const char* vendor, const char* compression,
                     const std::string& file) {
  const std::string domain = std::to_string(kDomain);
  const pid_t pid = fork();
  if (pid != 0) return pid;
  const int nowhere = ::open("/dev/null", O_WRONLY);
  dup2(nowhere, STDERR_FILENO);
  execl(hamel, hamel, "record", "-o", file.c_str(), "--bus", vendor, "--domain", domain.c_str(),
        "--compression", compression, nullptr);
  _exit(127);
}

/// The messages of an arm that moves, so that they compress as real ones do.
class Traffic {
 public:
  explicit Traffic(bus::Node& node)
      : states_(node), commands_(node), reports_(node), sets_(node), clocks_(node) {
    state_.position.setZero(kJoints), state_.velocity.setZero(kJoints);
    state_.momentum.setZero(kJoints), state_.torque_applied.setZero(kJoints);
    command_.torque.setZero(kJoints);
    report_.links.resize(kJoints);
    set_.obstacles.resize(kObstacles);
    for (std::uint32_t i = 0; i < kObstacles; ++i) set_.obstacles[i].id = i + 1;
    state_.arm = command_.arm = report_.arm = clock_.arm = set_.source = 1;
    report_.method = "gyro";
    clock_.running = true;
  }
  bool ready() const {
    return states_.matched() > 0 && commands_.matched() > 0 && reports_.matched() > 0 &&
           sets_.matched() > 0 && clocks_.matched() > 0;
  }
  void send(std::uint64_t k) {
    const double t_s = static_cast<double>(k) * 1e-3;
    const auto number = [&](int i) { return std::sin(t_s * (1 + 0.37 * i)) * (1 + i); };
    for (int i = 0; i < kJoints; ++i) {
      state_.position[i] = number(i), state_.velocity[i] = number(i + 7), state_.momentum[i] = number(i + 14);
      state_.torque_applied[i] = command_.torque[i] = number(i + 21);
      auto& l = report_.links[static_cast<std::size_t>(i)];
      l.link = static_cast<std::uint32_t>(i), l.distance_m = 1.5 + number(i + 28) / 40,
      l.phi_rad = number(i + 3);
      l.point_on_link_m = {number(i), number(i + 1), number(i + 2)};
      l.point_on_obstacle_m = {number(i + 3), number(i + 4), number(i + 5)};
      l.gyroscopic_N = {number(i + 6), number(i + 7), number(i + 8)};
    }
    state_.step = command_.step = report_.step = clock_.step = k;
    state_.t_s = command_.t_s = report_.t_s = clock_.t_s = t_s;
    report_.clearance_m = number(1), report_.speed_mps = number(2);
    sent["hamel/v1/state"] += states_.publish(state_);
    sent["hamel/v1/command"] += commands_.publish(command_);
    sent["hamel/v1/report"] += reports_.publish(report_);
    if (k % 10 == 0) sent["hamel/v1/clock"] += clocks_.publish(clock_);
    if (k % 33 != 0) return;
    set_.sequence_number = k / 33, set_.t_s = t_s;
    for (int i = 0; i < kObstacles; ++i)
      set_.obstacles[static_cast<std::size_t>(i)].X_WO.p = {number(i), number(i + 1), number(i + 2)};
    sent["hamel/v1/obstacles"] += sets_.publish(set_);
  }
  std::map<std::string, std::uint64_t> sent;

 private:
  wire::Publisher<wire::ArmState> states_;
  wire::Publisher<wire::TorqueCommand> commands_;
  wire::Publisher<wire::PlannerReport> reports_;
  wire::Publisher<wire::ObstacleSet> sets_;
  wire::Publisher<wire::SimulationClock> clocks_;
  wire::ArmState state_;
  wire::TorqueCommand command_;
  wire::PlannerReport report_;
  wire::ObstacleSet set_;
  wire::SimulationClock clock_;
};

/// Messages of each topic in a file.
std::map<std::string, std::uint64_t> count(const std::string& file) {
  std::map<std::string, std::uint64_t> out;
  auto reader = record::IndexedReader::open(file);
  if (!reader) return out;
  const record::Summary& s = reader.value().summary();
  for (const auto& [channel, n] : s.statistics->by_channel) out[s.channels.at(channel).topic] = n;
  return out;
}

/// True where it costs less than a tenth of a core and loses nothing.
bool measure(const char* hamel, bus::Vendor vendor, double seconds, const char* compression) {
  bus::NodeOptions options;
  options.vendor = vendor;
  options.domain = kDomain;
  auto node = bus::open(options);
  if (!node) {
    std::fprintf(stderr, "%s\n", to_string(node.error()).c_str());
    return false;
  }
  Traffic traffic(*node.value());
  const std::string file = "/tmp/hamel_record_bench_" + std::to_string(getpid()) + ".mcap";
  const pid_t recorder = start_recorder(hamel, bus::to_string(vendor), compression, file);
  const auto deadline = Clock::now() + 10s;
  while (!traffic.ready() && Clock::now() < deadline) std::this_thread::sleep_for(10ms);
  std::this_thread::sleep_for(500ms);
  const double before_s = processor_s(recorder);
  const auto began = Clock::now();
  auto next = began;
  for (std::uint64_t k = 0; k < static_cast<std::uint64_t>(seconds * 1000); ++k) {
    traffic.send(k);
    std::this_thread::sleep_until(next += 1ms);
  }
  const double took_s = std::chrono::duration<double>(Clock::now() - began).count();
  std::this_thread::sleep_for(100ms);
  const double used_s = processor_s(recorder) - before_s;
  kill(recorder, SIGINT);
  int status = 0;
  waitpid(recorder, &status, 0);
  std::uint64_t sent = 0, kept = 0;
  for (const auto& [topic, n] : traffic.sent) sent += n;
  for (const auto& [topic, n] : count(file)) kept += n;
  std::ifstream size(file, std::ios::ate | std::ios::binary);
  std::printf("%-11s %-5s %6.2f %% of a core, %llu of %llu messages kept, %.2f MB/s\n",
              bus::to_string(vendor), compression, 100 * used_s / took_s,
              static_cast<unsigned long long>(kept), static_cast<unsigned long long>(sent),
              static_cast<double>(size.tellg()) / 1e6 / took_s);
  std::remove(file.c_str());
  return used_s < 0.1 * took_s && kept == sent;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') {
    std::printf("hamel_record_bench HAMEL [seconds [compression]]\n");
    return argc < 2 ? 2 : 0;
  }
  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  const char* compression = argc > 3 ? argv[3] : "lz4";
  bool light = true;
  for (const auto vendor : {bus::Vendor::cyclonedds, bus::Vendor::fastdds})
    light &= measure(argv[1], vendor, seconds, compression);
  return light ? 0 : 1;
}
