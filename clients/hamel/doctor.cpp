#include "clients/hamel/doctor.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "clients/hamel/run_folder.h"
#include "common/runtime/realtime.h"
#include "common/wire/endpoint.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

enum class Verdict { good, note, wrong };

struct Finding {
  Verdict verdict;
  std::string what, text, mend;
};
using Findings = std::vector<Finding>;

std::string first_line(const std::string& path) {
  std::ifstream f(path);
  std::string line;
  std::getline(f, line);
  return line;
}

/// Whether a datagram to the group of DDS's discovery, sent by this interface, comes back to this host.
bool multicast_comes_back(in_addr interface) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = inet_addr("239.255.0.1");
  socklen_t length = sizeof at;
  const ip_mreq group{at.sin_addr, interface};
  const timeval limit{1, 0};
  std::uint64_t sent = static_cast<std::uint64_t>(getpid()) << 32 | 0x68616d65, got = 0;
  bool back = bind(fd, reinterpret_cast<sockaddr*>(&at), length) == 0 &&
              getsockname(fd, reinterpret_cast<sockaddr*>(&at), &length) == 0 &&
              setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0 &&
              setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &interface, sizeof interface) == 0 &&
              setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit) == 0 &&
              sendto(fd, &sent, sizeof sent, 0, reinterpret_cast<sockaddr*>(&at), length) == sizeof sent;
  back = back && recv(fd, &got, sizeof got, 0) == sizeof got && got == sent;
  close(fd);
  return back;
}

void look_at_interfaces(const runtime::BusOptions& o, Findings& out) {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return;
  std::map<std::string, unsigned> flags;
  std::map<std::string, in_addr> addresses;
  for (const ifaddrs* i = list; i != nullptr; i = i->ifa_next)
    if (i->ifa_addr != nullptr && i->ifa_addr->sa_family == AF_INET) {
      flags[i->ifa_name] = i->ifa_flags;
      addresses[i->ifa_name] = reinterpret_cast<const sockaddr_in*>(i->ifa_addr)->sin_addr;
    }
  freeifaddrs(list);
  bool loopback = false;
  for (const auto& [name, f] : flags) {
    const bool up = (f & IFF_UP) != 0, multicast = (f & IFF_MULTICAST) != 0, lo = (f & IFF_LOOPBACK) != 0;
    loopback |= lo && up;
    if (up && (f & IFF_RUNNING) == 0) {  // what comes back then never was on the cable
      out.push_back({Verdict::note, "interface " + name,
                     "is up, but nothing is at the other end of its cable", "ip -brief link"});
      continue;
    }
    const std::string mode = lo          ? "used unless --interface names another"
                             : multicast ? "multicast discovery"
                                         : "no multicast: give every host as --peer";
    out.push_back({up ? Verdict::good : Verdict::note, "interface " + name, up ? mode : "is down",
                   up ? "" : "ip link set " + name + " up"});
    if (!up || !multicast || lo) continue;
    const bool back = multicast_comes_back(addresses[name]);
    out.push_back({back ? Verdict::good : Verdict::note, "multicast on " + name,
                   back ? "tried: a datagram came back" : "tried: nothing came back within a second",
                   back ? "" : "give every host as --peer, or open 239.255.0.1 in the firewall"});
  }
  if (!loopback) out.push_back({Verdict::wrong, "interface lo", "the loopback is down", "ip link set lo up"});
  if (!o.interface_name.empty() && !flags.contains(o.interface_name))
    out.push_back({Verdict::wrong, "interface " + o.interface_name, "is not there, or has no IPv4 address",
                   "ip -brief address"});
}

/// A sample through two nodes of each vendor, one to the other: what no list of settings can promise.
void look_at_bus(const runtime::BusOptions& o, Findings& out) {
  for (const auto vendor : {bus::Vendor::fastdds, bus::Vendor::cyclonedds}) {
    runtime::BusOptions b = o;
    b.vendor = bus::to_string(vendor);
    if (vendor == bus::Vendor::cyclonedds) b.discovery_server.clear();
    const std::string name = fmt::format("{} on domain {}", b.vendor, b.domain);
    auto here = runtime::open_node(b, "", "hamel-doctor"), there = runtime::open_node(b, "", "hamel-doctor");
    if (!here || !there) {
      const Problem& p = !here ? here.error() : there.error();
      out.push_back({Verdict::wrong, name, to_string(p), "ss -uap, or another --domain"});
      continue;
    }
    static const Topic probe{"hamel/v1/doctor", "hamel::v1::Doctor", true, 0, 0ms, Delivery::latched, 256};
    const auto writer = here.value()->writer(probe);
    const auto reader = there.value()->reader(probe);
    bus::Payload payload(32), got;
    payload[1] = std::byte{1};
    const auto began = Clock::now();
    writer->write(payload);
    bool came = false;
    while (!(came = reader->take(got)) && Clock::now() - began < 5s) there.value()->wait(Clock::now() + 20ms);
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - began).count();
    if (came)
      out.push_back(
          {Verdict::good, name, fmt::format("two nodes met and a sample came after {:.0f} ms", ms), ""});
    else
      out.push_back({Verdict::wrong, name, "two nodes of this process do not meet within 5 s",
                     "a firewall? UDP ports 7400 + 250 * domain and up must be open"});
  }
}

/// UDP ports of a domain that somebody has bound.
void look_at_ports(const runtime::BusOptions& o, Findings& out) {
  std::ifstream udp("/proc/net/udp");
  std::set<int> taken;
  for (std::string line; std::getline(udp, line);) {
    unsigned slot = 0, address = 0, port = 0;
    if (std::sscanf(line.c_str(), " %u: %x:%x", &slot, &address, &port) == 3)
      taken.insert(static_cast<int>(port));
  }
  const int first = 7400 + 250 * static_cast<int>(o.domain) + 10;
  int used = 0;
  for (int index = 0; index < 50; ++index) used += taken.contains(first + 2 * index);
  const std::string text = fmt::format("{} of 50 participants of this host are in use", used);
  out.push_back({used > 45 ? Verdict::wrong : Verdict::good, fmt::format("domain {}", o.domain), text,
                 used > 45 ? "end some (hamel status), or another --domain" : ""});
}

void look_at_leftovers(Findings& out) {
  std::error_code ignored;
  int files = 0;
  for (const auto& e : std::filesystem::directory_iterator("/dev/shm", ignored)) {
    const std::string name = e.path().filename().string();
    files +=
        name.starts_with("fastrtps_") || name.starts_with("fast_datasharing_") || name.starts_with("iceoryx");
  }
  if (files > 0)
    out.push_back(
        {Verdict::note, "shared memory",
         fmt::format("{} files of other DDS programs in /dev/shm; hamel makes and reads none", files),
         "fastdds shm clean; rm /dev/shm/fast_datasharing_*   (with those programs ended)"});
  else
    out.push_back({Verdict::good, "shared memory", "nothing left over in /dev/shm", ""});
  const auto folders = abandoned_folders();
  out.push_back({folders.empty() ? Verdict::good : Verdict::note, "run folders",
                 folders.empty() ? "none left over"
                                 : fmt::format("{} of killed runs in {}", folders.size(),
                                               std::filesystem::temp_directory_path().string()),
                 folders.empty() ? "" : "the next hamel up removes them"});
}

void look_at_buffers(Findings& out) {
  for (const char* name : {"rmem_max", "wmem_max"}) {
    const long bytes = std::atol(first_line(fmt::format("/proc/sys/net/core/{}", name)).c_str());
    constexpr long kEnough = 1 << 20;
    if (bytes == 0) continue;
    out.push_back({bytes >= kEnough ? Verdict::good : Verdict::note, fmt::format("net.core.{}", name),
                   fmt::format("{} kB{}", bytes / 1024,
                               bytes >= kEnough ? "" : ": large obstacle sets may be sent twice"),
                   bytes >= kEnough ? "" : fmt::format("sysctl -w net.core.{}=4194304", name)});
  }
}

void look_at_clock(Findings& out) {
  const std::string source = first_line("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  const bool slow = source == "hpet" || source == "acpi_pm" || source == "jiffies";
  out.push_back({slow ? Verdict::note : Verdict::good, "clock",
                 source.empty() ? "source unknown" : "source " + source,
                 slow ? "boot with clocksource=tsc, where the machine allows it" : ""});
  timex t{};
  const bool synchronised = adjtimex(&t) != TIME_ERROR;
  out.push_back({synchronised ? Verdict::good : Verdict::note, "time of day",
                 synchronised ? "synchronised" : "not synchronised; matters between hosts only",
                 synchronised ? "" : "timedatectl set-ntp true"});
}

/// Whether a process of ours would be given it; tried in a child, which ends with it.
bool given(const runtime::RealtimeOptions& wanted) {
  const pid_t pid = fork();
  if (pid == 0) _exit(runtime::go_realtime(wanted).empty() ? 0 : 1);
  int status = 1;
  return pid > 0 && waitpid(pid, &status, 0) == pid && status == 0;
}

void look_at_privileges(Findings& out) {
  rlimit priority{}, memory{};
  getrlimit(RLIMIT_RTPRIO, &priority);
  getrlimit(RLIMIT_MEMLOCK, &memory);
  const bool may = given({.priority = 1}), locks = given({.lock_memory = true});
  out.push_back({may ? Verdict::good : Verdict::note, "--priority",
                 may ? "tried, and given" : fmt::format("refused; RLIMIT_RTPRIO is {}", priority.rlim_cur),
                 may ? "" : "setcap cap_sys_nice+ep on the programs, or LimitRTPRIO=99 in the unit"});
  out.push_back(
      {locks ? Verdict::good : Verdict::note, "--lock-memory",
       locks ? "tried, and given" : fmt::format("refused; RLIMIT_MEMLOCK is {} kB", memory.rlim_cur / 1024),
       locks ? "" : "ulimit -l unlimited as root, or LimitMEMLOCK=infinity in the unit"});
}

void look_at_environment(Findings& out) {
  for (const char* name : {"CYCLONEDDS_URI", "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_DISCOVERY_SERVER"})
    if (std::getenv(name) != nullptr)
      out.push_back({Verdict::note, name, "is set, and not consulted: hamel takes its options only",
                     fmt::format("unset {}", name)});
}

/// Who runs, of which version.
void look_at_services(const runtime::BusOptions& o, Findings& out) {
  auto node = runtime::open_node(o, "", "hamel-doctor");
  if (!node) return;
  wire::Subscription<wire::ServiceStatus> sub(*node.value());
  std::map<bus::WriterId, wire::ServiceStatus> seen;
  const auto deadline = Clock::now() + 1500ms;
  wire::ServiceStatus s;
  do {
    while (sub.take(s)) seen[sub.from()] = s;
    node.value()->wait(deadline);
  } while (Clock::now() < deadline);
  for (const auto& [id, v] : seen) {
    const bool same = v.idl_hash == wire::idl_hash();
    out.push_back({same ? Verdict::good : Verdict::wrong,
                   fmt::format("arm {} {}", v.arm, wire::to_string(v.kind)),
                   same ? fmt::format("{}, {}", v.version, v.bus)
                        : fmt::format("{}: another IDL than ours ({})", v.version, wire::idl_hash()),
                   same ? "" : "install the same version on every host"});
  }
  if (sub.undecodable() > 0)
    out.push_back({Verdict::wrong, "status topic",
                   fmt::format("{} messages that do not decode: {} {}", sub.undecodable(),
                               sub.last_error().field, sub.last_error().rule),
                   "hamel topic list shows who writes them"});
}

}  // namespace

int doctor(const DoctorArgs& args) {
  Findings all;
  all.push_back({Verdict::good, "version", runtime::version(), ""});
  for (const auto vendor : {bus::Vendor::fastdds, bus::Vendor::cyclonedds})
    all.push_back(
        {Verdict::good, fmt::format("{} version", bus::to_string(vendor)), bus::library_version(vendor), ""});
  look_at_interfaces(args.bus, all);
  look_at_ports(args.bus, all);
  look_at_bus(args.bus, all);
  look_at_services(args.bus, all);
  look_at_leftovers(all);
  look_at_buffers(all);
  look_at_clock(all);
  look_at_privileges(all);
  look_at_environment(all);

  static constexpr const char* kNames[] = {"ok", "note", "WRONG"};
  bool wrong = false;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : all) {
    wrong |= f.verdict == Verdict::wrong;
    const char* verdict = kNames[static_cast<int>(f.verdict)];
    if (args.json) {
      list.push_back({{"verdict", verdict}, {"what", f.what}, {"text", f.text}, {"mend", f.mend}});
      continue;
    }
    fmt::print("{:<5} {:<26} {}\n", verdict, f.what, f.text);
    if (!f.mend.empty()) fmt::print("      {:<26} -> {}\n", "", f.mend);
  }
  if (args.json) fmt::print("{}\n", nlohmann::ordered_json{{"findings", list}}.dump(2));
  return wrong ? runtime::kFailed : runtime::kDone;
}

}  // namespace hamel::client
