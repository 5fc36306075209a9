#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "clients/hamel/commands.h"
#include "common/runtime/loop.h"
#include "common/runtime/signals.h"
#include "common/wire/endpoint.h"

namespace hamel::client {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

constexpr auto kPatience = 5s;
constexpr auto kAnyPlanner = 1s;  // a planner says something ten times a second

Result<std::unique_ptr<bus::Node>, Problem> client_node(const runtime::BusOptions& o) {
  return runtime::open_node(o, "", "hamel-client");
}

/// Takes from `sub` until `wanted` holds; false after `patience`.
template <class T, class Wanted>
bool wait_for(bus::Node& node, wire::Subscription<T>& sub, T& m, Wanted wanted,
              Clock::duration patience = kPatience) {
  const auto deadline = Clock::now() + patience;
  do {
    while (sub.take(m))
      if (wanted(m)) return true;
    node.wait(deadline);
  } while (Clock::now() < deadline);
  return false;
}

int nobody(const char* verb, const char* whom, const runtime::BusOptions& o) {
  fmt::print(stderr, "hamel {}: no {} answered within {} s on domain {}{}\n", verb, whom, kPatience.count(),
             o.domain, o.interface_name.empty() ? " (loopback)" : " (" + o.interface_name + ")");
  return runtime::kNoData;
}

/// The goal on the command line, without an id yet.
Result<wire::Goal, Problem> goal_of(const GoalArgs& args) {
  wire::Goal g;
  g.arm = args.arm;
  const auto& from = !args.pose.empty() ? args.pose : args.position_m;
  if (!args.joints.empty()) {
    if (args.joints.size() > wire::kMaxJoints)
      return Problem{"--joints", fmt::format("{} values, at most {}", args.joints.size(), wire::kMaxJoints)};
    g.kind = wire::GoalKind::joints;
    g.joints =
        Eigen::Map<const Eigen::VectorXd>(args.joints.data(), static_cast<Eigen::Index>(args.joints.size()));
  } else {
    g.kind = args.pose.empty() ? wire::GoalKind::position : wire::GoalKind::pose;
    g.position_m = Eigen::Map<const Eigen::Vector3d>(from.data());
  }
  if (!args.pose.empty()) {
    g.orientation_xyzw = Eigen::Map<const Eigen::Vector4d>(args.pose.data() + 3);
    const double norm = g.orientation_xyzw.norm();
    if (!(norm > 1e-6)) return Problem{"--pose", "the quaternion must not be zero"};
    g.orientation_xyzw /= norm;
  }
  if (!g.position_m.allFinite() || !g.orientation_xyzw.allFinite() || !g.joints.allFinite())
    return Problem{"target", "every number must be finite"};
  return g;
}

}  // namespace

int goal(const GoalArgs& args) {
  auto node = client_node(args.bus);
  if (!node) return runtime::complain("hamel goal", {node.error()});
  bus::Node& n = *node.value();
  auto asked = goal_of(args);
  if (!asked) return runtime::complain("hamel goal", {asked.error()});
  wire::Goal g = std::move(asked).value();
  if (!args.joints.empty()) {
    wire::Subscription<wire::ArmState> states(n, bus::Ask::glimpse);
    wire::ArmState s;
    if (!wait_for(n, states, s, [&](const auto& m) { return m.arm == args.arm; }))
      return nobody("goal", "arm", args.bus);
    if (s.position.size() != g.joints.size())
      return runtime::complain(
          "hamel goal", {{"--joints", fmt::format("{} values, arm {} has {} joints", g.joints.size(), s.arm,
                                                  s.position.size())}});
  }
  wire::Publisher<wire::Goal> out(n);
  wire::Subscription<wire::PlannerReport> reports(n, bus::Ask::glimpse);
  wire::PlannerReport r;
  if (!wait_for(n, reports, r, [&](const auto& m) { return m.arm == args.arm; }))
    return nobody("goal", "planner", args.bus);
  g.id = r.goal_id + 1;
  if (!out.publish(g)) return runtime::complain("hamel goal", {{"goal", "the bus refused it"}});
  if (!wait_for(n, reports, r, [&](const auto& m) { return m.arm == args.arm && m.goal_id >= g.id; })) {
    fmt::print(
        stderr,
        "hamel goal: the planner of arm {} speaks ({}) but has not confirmed goal {}; it may yet take it\n",
        args.arm, wire::to_string(r.state), g.id);
    return runtime::kNoData;
  }
  fmt::print("goal {} taken by arm {}: {}{}{}\n", r.goal_id, r.arm, wire::to_string(r.state),
             r.reason == wire::Reason::none ? "" : std::string(" ") + wire::to_string(r.reason),
             r.detail.empty() ? "" : ", " + r.detail);
  const bool refused = r.reason == wire::Reason::unreachable || r.state == wire::PlannerState::fault;
  return refused ? runtime::kFailed : runtime::kDone;
}

int mode(const ModeArgs& args) {
  static const std::map<std::string, wire::Mode> kModes{{"stop", wire::Mode::stop},
                                                        {"hold", wire::Mode::hold},
                                                        {"resume", wire::Mode::resume},
                                                        {"clear-fault", wire::Mode::clear_fault}};
  const wire::Mode wanted = kModes.at(args.mode);
  auto node = client_node(args.bus);
  if (!node) return runtime::complain("hamel " + args.mode, {node.error()});
  bus::Node& n = *node.value();
  wire::Publisher<wire::ModeCommand> out(n);
  wire::Subscription<wire::ArmState> states(n, bus::Ask::glimpse);
  wire::Subscription<wire::PlannerReport> reports(n, bus::Ask::glimpse);
  wire::ArmState s;
  if (!wait_for(n, states, s, [&](const auto& m) { return m.arm == args.arm; }))
    return nobody(args.mode.c_str(), "arm", args.bus);
  // Mode ids only have to grow: the wall clock does, over all clients.
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  const wire::ModeCommand c{
      .arm = args.arm,
      .id = static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(since).count()),
      .mode = wanted};
  if (!out.publish(c)) return runtime::complain("hamel " + args.mode, {{"mode", "the bus refused it"}});
  const auto obeyed = [&](const wire::ArmState& m) {
    if (m.arm != args.arm) return false;
    if (wanted == wire::Mode::stop) return m.validity == wire::Validity::stopped;
    if (wanted == wire::Mode::hold) return m.validity == wire::Validity::holding;
    if (wanted == wire::Mode::clear_fault) return true;
    return m.validity == wire::Validity::valid || m.validity == wire::Validity::command_stale;
  };
  if (!wait_for(n, states, s, obeyed)) return nobody(args.mode.c_str(), "arm", args.bus);
  // A writer that leaves takes what is not yet delivered with it: the planner must have it, too, if there is
  // one.
  wire::PlannerReport r;
  const auto ours = [&](const auto& m) { return m.arm == args.arm; };
  const bool steered = wait_for(n, reports, r, ours, kAnyPlanner);
  if (steered && r.mode_id < c.id &&
      !wait_for(n, reports, r, [&](const auto& m) { return ours(m) && m.mode_id >= c.id; }))
    return nobody(args.mode.c_str(), "planner", args.bus);
  fmt::print("arm {}: {} at t = {:.3f} s{}\n", s.arm, wire::to_string(s.validity), s.t_s,
             steered ? "" : "; no planner is heard");
  return runtime::kDone;
}

int status(const StatusArgs& args) {
  auto node = client_node(args.bus);
  if (!node) return runtime::complain("hamel status", {node.error()});
  bus::Node& n = *node.value();
  wire::Subscription<wire::ServiceStatus> sub(n);
  std::map<std::tuple<std::uint32_t, wire::ServiceKind, bus::WriterId>, wire::ServiceStatus> seen;
  const auto deadline = Clock::now() + runtime::seconds(args.seconds);
  wire::ServiceStatus s;
  do {
    while (sub.take(s)) seen[{s.arm, s.kind, sub.from()}] = s;
    n.wait(deadline);
  } while (Clock::now() < deadline);
  if (args.json) {
    nlohmann::ordered_json j = nlohmann::ordered_json::array();
    for (const auto& [key, v] : seen) {
      nlohmann::ordered_json counters = nlohmann::ordered_json::object();
      for (const auto& c : v.counters) counters[c.name] = c.value;
      j.push_back({{"arm", v.arm},
                   {"service", wire::to_string(v.kind)},
                   {"state", wire::to_string(v.state)},
                   {"detail", v.detail},
                   {"version", v.version},
                   {"idl_hash", v.idl_hash},
                   {"bus", v.bus},
                   {"incarnation", v.incarnation},
                   {"counters", counters}});
    }
    fmt::print("{}\n", nlohmann::ordered_json{{"services", j}}.dump(2));
  } else {
    for (const auto& [key, v] : seen) {
      fmt::print("arm {} {:<11} {:<9} {:<12} {} {}\n", v.arm, wire::to_string(v.kind),
                 wire::to_string(v.state), v.detail, v.bus, v.version);
      std::string line;
      for (const auto& c : v.counters) line += fmt::format(" {} {}", c.name, c.value);
      fmt::print("     {}\n", line);
      if (v.idl_hash != wire::idl_hash())
        fmt::print("      other IDL: {}, ours is {}: they may not understand each other\n", v.idl_hash,
                   wire::idl_hash());
      else if (v.version != runtime::version())
        fmt::print("      other version than ours, {}\n", runtime::version());
      const auto same_name = [&](const auto& other) {
        return other.second.arm == v.arm && other.second.kind == v.kind;
      };
      if (std::count_if(seen.begin(), seen.end(), same_name) > 1)
        fmt::print("      one of several for this arm; incarnation or epoch {}\n", v.incarnation);
    }
  }
  if (sub.undecodable() > 0)
    fmt::print(stderr, "hamel status: {} messages did not decode (another IDL?): {} {}\n", sub.undecodable(),
               sub.last_error().field, sub.last_error().rule);
  if (seen.empty()) {
    fmt::print(stderr, "hamel status: no service spoke within {} s on domain {}\n", args.seconds,
               args.bus.domain);
    return runtime::kNoData;
  }
  return runtime::kDone;
}

}  // namespace hamel::client
