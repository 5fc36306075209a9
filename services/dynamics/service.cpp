#include "services/dynamics/service.h"

#include <algorithm>
#include <cmath>

#include "common/runtime/options.h"
#include "services/dynamics/convert.h"

namespace hamel::dynamics {

using namespace std::chrono_literals;

namespace {

constexpr auto kRepeat = 100ms;  // lockstep: say it again to peers that came late
constexpr int kBurst = 64;       // steps before the other services of the process get their turn

/// A fresh start must not be taken for the continuation of an earlier run of this arm.
std::uint64_t fresh_incarnation(scene::Pace pace) {
  if (pace == scene::Pace::lockstep) return 1;
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(since).count());
}

}  // namespace

const char* to_string(Outcome v) {
  switch (v) {
    case Outcome::running:
      return "running";
    case Outcome::done:
      return "done";
    case Outcome::no_command:
      return "no_command";
    case Outcome::diverged:
      return "diverged";
    case Outcome::not_alone:
      return "not_alone";
  }
  return "?";
}

Result<std::unique_ptr<DynamicsService>, Problem> DynamicsService::make(bus::Node& node,
                                                                        const scene::Scene& scene,
                                                                        const ServiceConfig& config) {
  std::unique_ptr<DynamicsService> s(new DynamicsService(node, scene, config));
  if (config.state_dir.empty()) return s;
  auto c = s->open_checkpoint();
  if (!c) return c.error();
  s->checkpoint_ = std::move(c).value();
  return s;
}

int DynamicsService::exit_code() const {
  switch (outcome_) {
    case Outcome::no_command:
      return runtime::kNoData;
    case Outcome::diverged:
      return runtime::kFailed;
    case Outcome::not_alone:
      return runtime::kBadInput;
    default:
      return runtime::kDone;
  }
}

DynamicsService::DynamicsService(bus::Node& node, const scene::Scene& scene, const ServiceConfig& config)
    : scene_(scene),
      config_(config),
      arm_(scene_),
      cadence_(scene_),
      fingerprint_(scene::fingerprint(scene)),
      incarnation_(config.incarnation != 0 ? config.incarnation : fresh_incarnation(config.pace)),
      state_out_(node),
      clock_out_(node),
      summary_out_(node),
      robot_out_(node),
      command_in_(node),
      mode_in_(node),
      clock_in_(node),
      presence_(node, wire::ServiceKind::dynamics, scene.arm) {
  const double dt = scene.dynamics.dt_s;
  last_step_ = static_cast<std::uint64_t>(std::llround(scene.duration_s / dt));
  clock_every_ = static_cast<std::uint64_t>(std::max(1.0, std::floor(0.01 / dt + 1e-9)));
  command_ = Eigen::VectorXd::Zero(scene.robot.chain.n());
  hash_.add(arm_.state().step, arm_.state().q, arm_.state().p);
}

bool DynamicsService::at_end() const { return !config_.endless && arm_.state().step >= last_step_; }

bool DynamicsService::poll(Time now) {
  if (finished()) return false;
  if (!started_) {
    started_ = true;
    next_step_ = waiting_since_ = last_publish_ = last_poll_ = now;
    wire::RobotDescription d;
    d.arm = scene_.arm;
    d.name = scene_.robot.name;
    d.urdf = scene_.robot.urdf;
    d.effort_limits.resize(arm_.state().q.size());
    for (int i = 0; i < scene_.robot.chain.n(); ++i)
      d.effort_limits[i] = scene_.robot.chain.joint(i).limits.effort;
    robot_out_.publish(d);
    publish_clock(true);
    publish_state();
  }
  meet_other_arms(now);
  if (finished()) return true;
  take_modes();
  take_commands();
  const bool progressed = config_.pace == scene::Pace::lockstep ? poll_lockstep(now) : poll_realtime(now);
  publish_periodic(now);
  return progressed;
}

runtime::Clock::time_point DynamicsService::due() const {
  if (config_.pace == scene::Pace::realtime) return next_step_;
  return last_publish_ + kRepeat;
}

void DynamicsService::take_modes() {
  wire::ModeCommand m;
  while (mode_in_.take(m)) {
    if (m.arm != scene_.arm || m.id <= mode_id_) continue;
    mode_id_ = m.id;
    spdlog::info("mode: {}", wire::to_string(m.mode));
    if (m.mode == wire::Mode::stop || m.mode == wire::Mode::hold) mode_ = m.mode;
    if (m.mode == wire::Mode::resume) mode_.reset();
  }
}

bool DynamicsService::awaits_command() {
  if (!scene_.steered) return false;
  const dynamics::State& s = arm_.state();
  const auto period = static_cast<std::uint64_t>(scene_.planner.period_steps);
  if (!command_step_ || *command_step_ < s.step / period * period) return true;
  return *command_step_ < s.step && cadence_.due(s.step, s.q, s.qd);
}

bool DynamicsService::poll_lockstep(Time now) {
  bool progressed = false;
  for (int i = 0; i < kBurst; ++i) {
    if (at_end()) {
      end(Outcome::done, "end of the run");
      return true;
    }
    if (awaits_command()) break;
    if (scene_.stop == scene::StopRule::when_reached && planner_state_ == wire::PlannerState::reached) {
      end(Outcome::done, "target reached");
      return true;
    }
    if (!step()) return true;
    last_publish_ = waiting_since_ = now;
    progressed = true;
  }
  if (progressed) return true;
  if (now - waiting_since_ > 1s && refusals_(now))
    spdlog::warn("step {} waits for the planner of arm {}, {:.0f} s so far{}", arm_.state().step, scene_.arm,
                 std::chrono::duration<double>(now - waiting_since_).count(), planner_waits());
  if (now - waiting_since_ > config_.patience) {
    end(Outcome::no_command,
        fmt::format("no planner answered step {} within {} s{}", arm_.state().step,
                    std::chrono::duration<double>(config_.patience).count(), planner_waits()));
    return true;
  }
  if (now - last_publish_ >= kRepeat) {
    last_publish_ = now;
    publish_clock(true);
    publish_state();
  }
  return false;
}

/// What the planner of this arm says that it waits for, where it says so.
std::string DynamicsService::planner_waits() const {
  const std::string word = presence_.word_of(wire::ServiceKind::planner, scene_.arm, waiting_since_ + 1s);
  return word.find("waits for") == std::string::npos ? "" : "; it says: " + word;
}

bool DynamicsService::poll_realtime(Time now) {
  if (now < next_step_) return false;
  count_lateness(now);
  for (int i = 0; i < 8 && now >= next_step_; ++i) {
    const bool reached =
        scene_.stop == scene::StopRule::when_reached && planner_state_ == wire::PlannerState::reached;
    if (at_end() || (reached && !config_.endless)) {
      end(Outcome::done, reached ? "target reached" : "end of the run");
      return true;
    }
    if (!step()) return true;
    next_step_ += runtime::seconds(scene_.dynamics.dt_s);
  }
  return true;
}

void DynamicsService::count_lateness(Time now) {
  const auto dt = runtime::seconds(scene_.dynamics.dt_s);
  if (now - next_step_ < dt) return;
  deadlines_missed_ += static_cast<std::uint64_t>((now - next_step_) / dt);
  // Up to 8 periods are caught up; more than that is given up, not run in a burst.
  if (now - next_step_ > 8 * dt) next_step_ = now;
}

/// Mode commands outrank the planner; a planner that is silent or absent leaves the arm holding still.
Drive DynamicsService::choose_drive() {
  if (mode_ || !command_step_) driven_from_.reset();
  if (mode_) {
    const bool stop = *mode_ == wire::Mode::stop;
    validity_ = stop ? wire::Validity::stopped : wire::Validity::holding;
    return {.kind = stop ? DriveKind::brake : DriveKind::hold};
  }
  if (!scene_.steered) {
    validity_ = wire::Validity::valid;
    return {.kind = DriveKind::free};
  }
  if (!command_step_) {
    validity_ = wire::Validity::holding;
    return {.kind = DriveKind::hold};
  }
  if (config_.pace == scene::Pace::realtime && command_age_s() > command_stale_s()) {
    ++commands_missed_;
    outages_ += validity_ == wire::Validity::valid;
    validity_ = wire::Validity::command_stale;
    driven_from_.reset();
    return {.kind = scene_.dynamics.on_silence == scene::Safe::hold ? DriveKind::hold : DriveKind::brake};
  }
  validity_ = wire::Validity::valid;
  if (!driven_from_) driven_from_ = step_now();
  return {.kind = DriveKind::torque,
          .torque_Nm = &command_,
          .includes_gravity = command_includes_gravity_,
          .share = share()};
}

/// Real time: a command that follows a hold comes in over planner.ramp_s, so that nothing jumps.
double DynamicsService::share() const {
  if (config_.pace == scene::Pace::lockstep || !(scene_.planner.ramp_s > 0)) return 1;
  const double driven_s = static_cast<double>(step_now() - *driven_from_) * scene_.dynamics.dt_s;
  return std::min(1.0, driven_s / scene_.planner.ramp_s);
}

std::int64_t DynamicsService::ramp_steps() const {
  return static_cast<std::int64_t>(std::ceil(scene_.planner.ramp_s / scene_.dynamics.dt_s));
}

bool DynamicsService::step() {
  if (!arm_.advance(choose_drive())) {
    validity_ = wire::Validity::diverged;
    publish_state();
    end(Outcome::diverged,
        fmt::format("no usable step at t = {:.6f} s: {} iterations left {} N m; a smaller dt_s may help",
                    arm_.t_s(), arm_.report().iterations, arm_.report().residual_Nm));
    return false;
  }
  hash_.add(arm_.state().step, arm_.state().q, arm_.state().p);
  save();
  if (arm_.state().step % clock_every_ == 0) publish_clock(true);
  publish_state();
  return true;
}

void DynamicsService::publish_state() {
  state_.arm = scene_.arm;
  state_.incarnation = incarnation_;
  state_.validity = validity_;
  to_wire(arm_, state_);
  state_out_.publish(state_);
}

void DynamicsService::publish_clock(bool running) {
  wire::SimulationClock c;
  c.arm = scene_.arm;
  c.incarnation = incarnation_;
  c.step = arm_.state().step;
  c.t_s = arm_.t_s();
  c.dt_s = scene_.dynamics.dt_s;
  c.pace = config_.pace == scene::Pace::lockstep ? wire::Pace::lockstep : wire::Pace::realtime;
  c.running = running;
  clock_out_.publish(c);
}

void DynamicsService::publish_summary(bool final_summary) {
  wire::RunSummary s;
  s.arm = scene_.arm;
  s.incarnation = incarnation_;
  s.final_summary = final_summary;
  s.outcome = to_string(outcome_);
  to_wire(arm_, s);
  s.commands_missed = commands_missed_;
  s.deadlines_missed = deadlines_missed_;
  s.trajectory_hash = hash_.hex();
  summary_out_.publish(s);
}

void DynamicsService::publish_status(Time now, wire::ServiceState state) {
  presence_.say(now, {.state = state,
                      .incarnation = incarnation_,
                      .detail = finished() ? to_string(outcome_) : wire::to_string(validity_),
                      .counters = {{"steps", arm_.state().step},
                                   {"outages", outages_},
                                   {"commands_refused", commands_refused_},
                                   {"commands_missed", commands_missed_},
                                   {"deadlines_missed", deadlines_missed_},
                                   {"undecodable", command_in_.undecodable() + mode_in_.undecodable()}}});
}

void DynamicsService::publish_periodic(Time now) {
  if (presence_.due(now)) {
    publish_status(now, wire::ServiceState::ready);
    publish_summary(finished());
  }
  if (checkpoint_) checkpoint_->sync(now);
}

void DynamicsService::end(Outcome outcome, const std::string& why) {
  outcome_ = outcome;
  if (outcome == Outcome::done)
    spdlog::debug("{}", why);
  else
    spdlog::error("{}", why);
  if (outcome == Outcome::not_alone) return;  // the arm's word is another's
  publish_clock(false);
  publish_summary(true);
}

void DynamicsService::close() {
  if (outcome_ == Outcome::not_alone) return;
  publish_clock(false);
  publish_summary(true);
  publish_status(runtime::Clock::now(), wire::ServiceState::stopping);
}

}  // namespace hamel::dynamics
