#pragma once
/// The perception stub in its shell: the run's clock in, obstacle sets out.

#include <memory>
#include <optional>
#include <string>

#include "common/runtime/log.h"
#include "common/runtime/loop.h"
#include "common/runtime/presence.h"
#include "common/scene/scene.h"
#include "common/wire/endpoint.h"
#include "services/perception/core/source.h"

namespace hamel::perception {

/// Sets have sample times k period_s on the run's clock; their content depends on k alone, so a restarted
/// perception goes on as if nothing had happened.  In lockstep sets are published one clock message ahead, so
/// that the planner need not wait for them, and none where nothing changes; in real time each period, when
/// its time has come.  Inside a gap of a stream nothing is published: the planner's last set grows old and it
/// says so.
///
/// While it is paused the sets go on and the world in them stands: places as they were, velocities zero.
class PerceptionService final : public runtime::Service {
 public:
  /// Fails with what scene::problems() says of the scene's perception.
  static Checked<std::unique_ptr<PerceptionService>> make(bus::Node& node, const scene::Scene& scene);
  bool poll(runtime::Clock::time_point now) override;
  runtime::Clock::time_point due() const override;
  bool finished() const override { return false; }
  int readers() const override { return sets_out_.matched(); }
  void close() override;

  /// The world stands, or goes on from where it stood.  Once called, sets promise no more than their period.
  void pause(bool on);
  /// Paused: the world moves on by one set.
  void step();
  bool paused() const { return paused_; }
  /// The time in the source that the last set showed.
  double shown_s() const { return static_cast<double>(shown_) * source_.period_s(); }

 private:
  using Time = runtime::Clock::time_point;
  PerceptionService(bus::Node& node, const scene::Scene& scene, Source source);

  bool hear_clock(Time now);
  double run_time_s(Time now) const;
  bool publish_until(double t_s);
  bool publish_set(std::uint64_t k, bool promise);
  std::uint64_t after(std::uint64_t k) const;
  void count_glitches(Time now);
  void publish_status(Time now, wire::ServiceState state);

  const std::uint32_t arm_;
  const Source source_;
  wire::Publisher<wire::ObstacleSet> sets_out_;
  wire::Subscription<wire::SimulationClock> clock_in_;
  runtime::Presence presence_;

  wire::ObstacleSet set_;
  std::optional<wire::SimulationClock> clock_;
  bus::WriterId clock_writer_{};
  Time clock_heard_{}, last_status_{};
  std::optional<std::uint64_t> next_;  ///< number of the next set; none: not begun
  std::uint64_t published_ = 0, repeated_ = 0, glitches_ = 0;
  runtime::RateLimit glitch_log_;
  bool controlled_ = false, paused_ = false;
  std::uint64_t steps_ = 0;  ///< asked for and not made yet
  std::int64_t shown_ = 0;   ///< what the last set showed, as its number without pauses
  std::int64_t behind_ = 0;  ///< sets by which pauses hold the world back; of a run begun anew, < 0: ahead
};

}  // namespace hamel::perception
