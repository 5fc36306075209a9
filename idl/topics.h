#pragma once
/// The whole map of the bus: every topic, its type, its promised rate and how it is delivered.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace hamel {

/// How a topic's samples reach its readers.  All are reliable and none lets a stopped reader block its
/// writer.
enum class Delivery : std::uint8_t {
  stream,   ///< volatile, the last kStreamDepth samples wait for a slow reader
  latched,  ///< the last sample of each key also reaches readers that come later
};

inline constexpr int kStreamDepth = 256;

/// Samples of one key that a writer keeps and that wait for a reader.
constexpr int depth_of(Delivery d) { return d == Delivery::latched ? 1 : kStreamDepth; }

struct Topic {
  std::string_view name;
  std::string_view type;
  bool keyed;                       ///< the key is the first member, an unsigned long
  double rate_hz;                   ///< promised by a realtime writer; 0 = on change
  std::chrono::milliseconds stale;  ///< a reader treats older data as absent; 0 = never
  Delivery delivery;
  std::size_t max_bytes;  ///< a larger payload is refused before it is decoded
};

namespace topics {
using namespace std::chrono_literals;
inline constexpr Topic kState{
    "hamel/v1/state", "hamel::v1::ArmState", true, 1000, 50ms, Delivery::stream, 4096};
inline constexpr Topic kCommand{
    "hamel/v1/command", "hamel::v1::TorqueCommand", true, 1000, 50ms, Delivery::stream, 4096};
inline constexpr Topic kGoal{"hamel/v1/goal", "hamel::v1::Goal", true, 0, 0ms, Delivery::latched, 4096};
inline constexpr Topic kObstacles{
    "hamel/v1/obstacles", "hamel::v1::ObstacleSet", true, 30, 300ms, Delivery::latched, 1 << 20};
inline constexpr Topic kReport{
    "hamel/v1/report", "hamel::v1::PlannerReport", true, 100, 500ms, Delivery::stream, 32768};
inline constexpr Topic kMode{"hamel/v1/mode", "hamel::v1::ModeCommand", true, 0, 0ms, Delivery::latched, 256};
inline constexpr Topic kStatus{
    "hamel/v1/status", "hamel::v1::ServiceStatus", true, 2, 2000ms, Delivery::latched, 32768};
inline constexpr Topic kRobot{
    "hamel/v1/robot", "hamel::v1::RobotDescription", true, 0, 0ms, Delivery::latched, 1 << 19};
inline constexpr Topic kClock{
    "hamel/v1/clock", "hamel::v1::SimulationClock", true, 100, 500ms, Delivery::stream, 256};
inline constexpr Topic kSummary{
    "hamel/v1/summary", "hamel::v1::RunSummary", true, 1, 5000ms, Delivery::latched, 4096};
}  // namespace topics

inline constexpr std::array kTopics{topics::kState,  topics::kCommand, topics::kGoal,   topics::kObstacles,
                                    topics::kReport, topics::kMode,    topics::kStatus, topics::kRobot,
                                    topics::kClock,  topics::kSummary};

// A rate without a staleness limit, a limit shorter than two periods, a name twice: refuse to build.
static_assert([] {
  for (std::size_t i = 0; i < kTopics.size(); ++i) {
    const Topic& t = kTopics[i];
    if ((t.rate_hz > 0) != (t.stale.count() > 0)) return false;
    if (t.rate_hz > 0 && static_cast<double>(t.stale.count()) * 1e-3 * t.rate_hz < 2) return false;
    if (!t.name.starts_with("hamel/v1/") || !t.type.starts_with("hamel::v1::") || t.max_bytes < 64)
      return false;
    for (std::size_t j = 0; j < i; ++j)
      if (kTopics[j].name == t.name || kTopics[j].type == t.type) return false;
  }
  return true;
}());

}  // namespace hamel
