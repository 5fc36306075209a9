#pragma once
/// The dynamics service in its shell: state out, commands and modes in, in lockstep or in real time.

#include <memory>
#include <optional>
#include <string>

#include "common/runtime/checkpoint.h"
#include "common/runtime/log.h"
#include "common/runtime/loop.h"
#include "common/runtime/presence.h"
#include "common/scene/cadence.h"
#include "common/wire/endpoint.h"
#include "services/dynamics/arm.h"
#include "services/dynamics/trajectory_hash.h"

namespace hamel::dynamics {

struct ServiceConfig {
  scene::Pace pace = scene::Pace::lockstep;
  bool endless = false;                       ///< ignore the scene's duration: run until told to end
  std::string state_dir = {};                 ///< checkpoint folder; empty: none
  std::chrono::milliseconds patience{10000};  ///< lockstep: how long to wait for one command
  std::uint64_t incarnation = 0;              ///< of a replayed run; 0: a new one
  runtime::BootId boot = runtime::boot_id();  ///< a checkpoint of another raises the incarnation
};

/// How the run ended.
enum class Outcome : std::uint8_t { running, done, no_command, diverged, not_alone };
const char* to_string(Outcome v);

class DynamicsService final : public runtime::Service {
 public:
  /// Fails where the checkpoint cannot be opened.
  static Result<std::unique_ptr<DynamicsService>, Problem> make(bus::Node& node, const scene::Scene& scene,
                                                                const ServiceConfig& config);
  bool poll(runtime::Clock::time_point now) override;
  runtime::Clock::time_point due() const override;
  bool finished() const override { return outcome_ != Outcome::running; }
  int exit_code() const override;
  int readers() const override { return state_out_.matched(); }
  void close() override;

  Outcome outcome() const { return outcome_; }
  const Arm& arm() const { return arm_; }

 private:
  using Time = runtime::Clock::time_point;
  DynamicsService(bus::Node& node, const scene::Scene& scene, const ServiceConfig& config);

  void take_modes();
  void take_commands();
  void meet_other_arms(Time now);
  bool fits(const wire::TorqueCommand& c);
  bool owns(const wire::TorqueCommand& c);
  double share() const;
  std::int64_t step_now() const { return static_cast<std::int64_t>(arm_.state().step); }
  std::int64_t ramp_steps() const;
  bool poll_lockstep(Time now);
  std::string planner_waits() const;
  bool poll_realtime(Time now);
  void count_lateness(Time now);
  bool owner_is_silent() const;
  double command_age_s() const;
  double command_stale_s() const;
  bool awaits_command();
  bool at_end() const;
  Drive choose_drive();
  bool step();
  void publish_state();
  void publish_clock(bool running);
  void publish_summary(bool final_summary);
  void publish_status(Time now, wire::ServiceState state);
  void publish_periodic(Time now);
  void end(Outcome outcome, const std::string& why);
  Result<std::unique_ptr<runtime::Checkpoint>, Problem> open_checkpoint();
  void save();
  std::string load(std::span<const std::byte> bytes, bool rebooted);

  const scene::Scene scene_;
  const ServiceConfig config_;
  Arm arm_;
  scene::Cadence cadence_;
  TrajectoryHash hash_;
  const std::uint64_t fingerprint_;
  std::uint64_t incarnation_ = 1, last_step_ = 0;

  wire::Publisher<wire::ArmState> state_out_;
  wire::Publisher<wire::SimulationClock> clock_out_;
  wire::Publisher<wire::RunSummary> summary_out_;
  wire::Publisher<wire::RobotDescription> robot_out_;
  wire::Subscription<wire::TorqueCommand> command_in_;
  wire::Subscription<wire::ModeCommand> mode_in_;
  wire::Subscription<wire::SimulationClock> clock_in_;
  runtime::Presence presence_;

  wire::ArmState state_;
  wire::TorqueCommand incoming_;
  Eigen::VectorXd command_;                    ///< the torque that holds now
  std::optional<std::uint64_t> command_step_;  ///< the state step it answers; none: no command yet
  bool command_includes_gravity_ = false;
  wire::PlannerState planner_state_ = wire::PlannerState::idle;
  std::uint64_t epoch_ = 0;
  bus::WriterId owner_{};  ///< of the planner that drives the arm
  /// The step at which its ramp out of a hold began; a run's first command has its ramp behind it.
  std::optional<std::int64_t> driven_from_;
  std::optional<wire::Mode> mode_;  ///< stop or hold while one is in force
  std::uint64_t mode_id_ = 0;
  wire::Validity validity_ = wire::Validity::holding;

  std::uint64_t commands_missed_ = 0, deadlines_missed_ = 0, commands_refused_ = 0, outages_ = 0;
  std::uint64_t clock_every_ = 1;
  Time next_step_{}, last_publish_{}, waiting_since_{}, last_poll_{}, young_until_{};
  bool started_ = false;
  Outcome outcome_ = Outcome::running;
  std::unique_ptr<runtime::Checkpoint> checkpoint_;
  std::vector<std::byte> packed_;
  runtime::RateLimit refusals_;
};

}  // namespace hamel::dynamics
