#pragma once
/// The planner service in its shell: states, obstacles, goals and modes in, commands and reports out.

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "common/runtime/checkpoint.h"
#include "common/runtime/log.h"
#include "common/runtime/loop.h"
#include "common/runtime/presence.h"
#include "common/scene/cadence.h"
#include "common/wire/endpoint.h"
#include "services/planner/aside.h"
#include "services/planner/core/escape.h"
#include "services/planner/core/planner.h"
#include "services/planner/core/reachable.h"
#include "services/planner/obstacle_view.h"

namespace hamel::planner {

struct ServiceConfig {
  scene::Pace pace = scene::Pace::lockstep;
  std::string state_dir = {};  ///< checkpoint folder; empty: none
  std::uint32_t strength = 0;  ///< of several planners for one arm the strongest that is heard drives it
  runtime::BootId boot = runtime::boot_id();
  bool patient = false;  ///< real time waits, too, for an answer that is due: for replays, which have time
};

class PlannerService final : public runtime::Service {
 public:
  /// Fails where the checkpoint cannot be opened.
  static Result<std::unique_ptr<PlannerService>, Problem> make(bus::Node& node, const scene::Scene& scene,
                                                               const ServiceConfig& config);
  bool poll(runtime::Clock::time_point now) override;
  runtime::Clock::time_point due() const override;
  bool finished() const override { return false; }
  int readers() const override { return std::min(command_out_.matched(), report_out_.matched()); }
  void close() override;

 private:
  using Time = runtime::Clock::time_point;
  PlannerService(bus::Node& node, const scene::Scene& scene, const ServiceConfig& config);

  void take_goals();
  void take_modes();
  bool take_states(Time now);
  void take_obstacles();
  void meet(const wire::ArmState& s);
  bool leaps(const wire::ArmState& s, Time now);
  bool answer(Time now);
  void plan(Time now);
  bool waits() const;
  void pursue();
  void pursue_again(const Reachability& known);
  void take_look();
  void enter_look(bool wait);
  void ask_escape(const Input& in);
  void start_escape();
  void take_escape();
  void fill_command();
  void publish_report(Time now, bool always);
  bool waits_for_obstacles() const;
  std::string whom_it_waits_for() const;
  void report_silence(Time now);
  void send_report(Time now);
  void publish_status(Time now, wire::ServiceState state);
  std::optional<Problem> open_checkpoint();
  void pack_question();
  void save();
  std::string load(std::span<const std::byte> bytes);

  const scene::Scene scene_;
  const ServiceConfig config_;
  const std::uint64_t fingerprint_;
  scene::Cadence cadence_;
  Planner planner_;
  Output output_;
  std::uint64_t epoch_ = 1;          ///< strength * 2^32 + starts
  std::optional<scene::Goal> goal_;  ///< the newest

  wire::Publisher<wire::TorqueCommand> command_out_;
  wire::Publisher<wire::PlannerReport> report_out_;
  wire::Subscription<wire::ArmState> state_in_;
  wire::Subscription<wire::ObstacleSet> obstacles_in_;
  wire::Subscription<wire::Goal> goal_in_;
  wire::Subscription<wire::ModeCommand> mode_in_;
  runtime::Presence presence_;

  wire::ArmState state_;
  wire::ObstacleSet set_;
  wire::TorqueCommand command_;
  wire::PlannerReport report_;
  ObstacleView view_;
  double obstacle_age_s_ = 0;
  Eigen::VectorXd q_, qd_;

  bool have_state_ = false, answered_ = true;  ///< answered: the newest state has its command
  Time unanswered_since_{};
  std::optional<std::uint64_t> incarnation_;  ///< of the arm we know
  bus::WriterId arm_writer_{};                ///< who speaks for it
  std::optional<std::uint64_t> memory_step_;  ///< the step our memory stands at
  std::optional<wire::Mode> mode_;
  std::uint64_t mode_id_ = 0, commands_late_ = 0, cycles_ = 0;
  wire::PlannerState shown_ = wire::PlannerState::idle;
  wire::Reason shown_reason_ = wire::Reason::none;
  double cycle_s_ = 0;
  Time last_state_{}, last_report_{}, last_silence_{};
  std::unique_ptr<runtime::Checkpoint> checkpoint_;
  std::vector<std::byte> packed_;
  Aside<Escape> escape_;  ///< asked: question_ is out, its answer due at step escape_due_
  EscapeQuestion question_;
  std::vector<std::byte> packed_question_;
  std::uint64_t escape_due_ = 0;
  Aside<Reachability> reach_;              ///< asked: whether goal looked_at_ can be reached
  std::optional<std::uint64_t> look_due_;  ///< the step its answer is due at; none before a cycle has waited
  std::uint64_t looked_at_ = 0;
  bool looking_ = false;     ///< goal_ waits for the answer: the planner keeps to the one before
  bool look_again_ = false;  ///< goal_ has moved on since it was asked about
  runtime::RateLimit refusals_, waits_;
  int leaps_in_a_row_ = 0;
  std::uint64_t states_discarded_ = 0;
};

}  // namespace hamel::planner
