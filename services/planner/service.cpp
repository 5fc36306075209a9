#include "services/planner/service.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/runtime/options.h"
#include "services/planner/convert.h"

namespace hamel::planner {

using namespace std::chrono_literals;

namespace {

constexpr auto kArmHeard = 200ms;  // an arm speaks at least each 100 ms: so long no other is heard
constexpr std::uint32_t kArmBits = 0x0fffffff;  // of an obstacle source: the arm it sees for
constexpr double kMemoryFresh_s = 0.2;          // older memory is ramped in again
constexpr double kLeapSlack = 1e-3;             // rad or m that a sample may be off without being wrong
constexpr int kLeapsBelieved = 3;               // so many leaps in a row are passed over
constexpr auto kReportPeriod = 10ms;            // realtime: a report each, and one at every change of state

}  // namespace

Result<std::unique_ptr<PlannerService>, Problem> PlannerService::make(bus::Node& node,
                                                                      const scene::Scene& scene,
                                                                      const ServiceConfig& config) {
  std::unique_ptr<PlannerService> s(new PlannerService(node, scene, config));
  if (auto problem = s->open_checkpoint()) return *problem;
  return s;
}

PlannerService::PlannerService(bus::Node& node, const scene::Scene& scene, const ServiceConfig& config)
    : scene_(scene),
      config_(config),
      fingerprint_(scene::fingerprint(scene)),
      cadence_(scene_),
      planner_(scene_.robot, scene_.planner, savings(scene_)),
      output_(planner_.output()),
      goal_(scene.goal),
      command_out_(node),
      report_out_(node),
      state_in_(node),
      obstacles_in_(node),
      goal_in_(node),
      mode_in_(node),
      presence_(node, wire::ServiceKind::planner, scene.arm),
      view_(scene_) {
  epoch_ += std::uint64_t{config.strength} << 32;
  if (goal_) planner_.set_goal(*goal_);
  report_.method = scene::to_string(scene.planner.method);
  q_.resize(scene.robot.chain.n());
  qd_.resize(scene.robot.chain.n());
}

bool PlannerService::poll(Time now) {
  take_modes();
  take_goals();
  take_obstacles();
  const bool heard = take_states(now);
  const bool planned = answer(now);
  if (!planned) report_silence(now);
  if (presence_.due(now)) publish_status(now, wire::ServiceState::ready);
  if (checkpoint_) checkpoint_->sync(now);
  return heard || planned;
}

runtime::Clock::time_point PlannerService::due() const {
  return std::max(last_report_, last_silence_) + 100ms;
}

void PlannerService::take_goals() {
  wire::Goal g;
  while (goal_in_.take(g)) {
    if (g.arm != scene_.arm || (goal_ && g.id < goal_->id)) continue;
    if (!goal_ || g.id > goal_->id) {
      spdlog::info("goal {}", g.id);
      escape_.forget();
    }
    goal_ = from_wire(g);
    pursue();
  }
}

void PlannerService::take_modes() {
  wire::ModeCommand m;
  while (mode_in_.take(m)) {
    if (m.arm != scene_.arm || m.id <= mode_id_) continue;
    mode_id_ = m.id;
    if (m.mode == wire::Mode::stop || m.mode == wire::Mode::hold) {
      mode_ = m.mode;
    } else {
      if (m.mode == wire::Mode::resume) mode_.reset();
      // From rest again, without the clocks and faults of before: the goal is as new.
      escape_.forget();
      planner_.clear_goal();
      pursue_again(planner_.reach());
      planner_.ramp_in();
    }
  }
}

void PlannerService::take_obstacles() {
  while (obstacles_in_.take(set_))
    if ((set_.source & kArmBits) == scene_.arm) view_.add(set_);
}

bool PlannerService::take_states(Time now) {
  bool heard = false;
  wire::ArmState s;
  while (state_in_.take(s)) {
    if (s.arm != scene_.arm) continue;
    if (s.position.size() != q_.size()) {
      if (refusals_(now))
        spdlog::warn("state with {} joints refused: arm {} has {}", s.position.size(), scene_.arm, q_.size());
      continue;
    }
    // Two arms of one key: the one that is known stays, as long as it is heard.
    const bus::WriterId from = state_in_.from();
    if (have_state_ && from != arm_writer_ && now - last_state_ < kArmHeard) {
      if (refusals_(now))
        spdlog::warn("another arm {} speaks on this domain (an earlier run?); not heard", s.arm);
      continue;
    }
    const bool same = have_state_ && from == arm_writer_ && s.incarnation == state_.incarnation;
    arm_writer_ = from;
    heard = true;
    last_state_ = now;
    if (same && s.step < state_.step) continue;  // overtaken on its way
    if (incarnation_ != s.incarnation) meet(s);
    // In lockstep the same state again means that our answer was lost: answer it again.
    if (!cadence_.due(s.step, s.position, s.velocity)) continue;
    if (leaps(s, now)) continue;
    const auto period = static_cast<std::uint64_t>(scene_.planner.period_steps);
    if (have_state_ && config_.pace == scene::Pace::realtime && s.step > state_.step + period)
      ++commands_late_;
    state_ = s;
    have_state_ = true;
    if (std::exchange(answered_, false)) unanswered_since_ = now;
  }
  return heard;
}

/// Real time: no joint can go farther than twice its speed allows, so that such a sample is wrong and passed
/// over; a few of them in a row are believed, and the arm starts from there with a ramp.
bool PlannerService::leaps(const wire::ArmState& s, Time now) {
  if (config_.pace == scene::Pace::lockstep || !have_state_ || s.step <= state_.step) return false;
  if (s.incarnation != state_.incarnation) return false;
  const double passed_s = static_cast<double>(s.step - state_.step) * s.dt_s;
  bool far = false;
  for (int j = 0; j < scene_.robot.chain.n(); ++j) {
    const double most = 2 * scene_.robot.chain.joint(j).limits.velocity * passed_s;
    far |= std::abs(s.position[j] - state_.position[j]) > most + kLeapSlack;
  }
  if (!far) {
    leaps_in_a_row_ = 0;
    return false;
  }
  ++states_discarded_;
  if (refusals_(now)) spdlog::warn("t = {:.3f} s: the arm's state leaps: passed over", s.t_s);
  if (++leaps_in_a_row_ <= kLeapsBelieved) return true;
  leaps_in_a_row_ = 0;
  planner_.ramp_in();
  return false;
}

/// An arm that does not continue the one we know: what we remember of its motion means nothing.
void PlannerService::meet(const wire::ArmState& s) {
  const bool known = incarnation_.has_value();
  incarnation_ = s.incarnation;
  if (known) spdlog::info("arm {} began anew (incarnation {})", s.arm, s.incarnation);
  if (s.caused_by.size > 0 && !memory_step_)
    spdlog::warn(
        "arm {} was driven before: what it was told since is not known here (--state-dir keeps it); goal {} "
        "of the scene holds",
        s.arm, goal_ ? goal_->id : 0);
  view_.begin(s.incarnation);
  escape_.forget();
  memory_step_.reset();
  const Reachability found = planner_.reach();
  planner_ = Planner(scene_.robot, scene_.planner, savings(scene_));
  pursue_again(found);
}

bool PlannerService::answer(Time now) {
  if (!have_state_ || answered_) return false;
  const bool lockstep = config_.pace == scene::Pace::lockstep;
  const bool known = command_.step == state_.step && command_.state_incarnation == state_.incarnation;
  if (lockstep && known && memory_step_ == state_.step) {
    command_out_.publish(command_);
    answered_ = true;
    return true;
  }
  if (waits_for_obstacles()) return false;
  plan(now);
  answered_ = true;
  fill_command();
  // Saved before it is said: whoever is killed in between says it again, not something else.
  if (lockstep) save();
  command_out_.publish(command_);
  publish_report(now, lockstep);
  if (!lockstep) save();
  return true;
}

void PlannerService::plan(Time now) {
  const Time began = runtime::Clock::now();
  q_ = state_.position;
  qd_ = state_.velocity;
  command_.caused_by.size = 0;
  command_.caused_by.add(wire::ServiceKind::dynamics, state_.step);
  obstacle_age_s_ = view_.at(state_.t_s, q_, command_.caused_by);
  if (goal_) command_.caused_by.add(wire::ServiceKind::client, goal_->id);

  const bool lockstep = config_.pace == scene::Pace::lockstep;  // waits as long as it takes: nothing ages
  const double period_s = static_cast<double>(scene_.planner.period_steps) * state_.dt_s;
  const double passed_s =
      memory_step_ ? static_cast<double>(state_.step - *memory_step_) * state_.dt_s : scene::kInf;
  const bool lost =
      !memory_step_ || *memory_step_ > state_.step || passed_s > std::max(kMemoryFresh_s, 3 * period_s);
  // An arm that nobody has driven yet waits at rest for the run to begin: at once.
  const bool untouched = state_.validity == wire::Validity::holding && state_.caused_by.size == 0;
  if (lost && !untouched) planner_.ramp_in();
  const Input in{.step = state_.step,
                 .t_s = state_.t_s,
                 .dt_s = period_s,
                 .q = q_,
                 .qd = qd_,
                 .obstacles = view_.obstacles(),
                 .obstacle_age_s = obstacle_age_s_,
                 .obstacle_set = view_.set(),
                 .state_age_s = lockstep ? 0 : std::chrono::duration<double>(now - last_state_).count(),
                 .obstacles_expected = true,
                 .link_floor_m = view_.link_floor_m()};
  take_look();
  take_escape();
  planner_.plan(in, output_);
  if (output_.report.escape_asked) {
    Input whole = in;  // the way out may lead far
    whole.obstacles = view_.all();
    ask_escape(whole);
  }
  memory_step_ = state_.step;
  ++cycles_;
  cycle_s_ = std::chrono::duration<double>(runtime::Clock::now() - began).count();
}

void PlannerService::fill_command() {
  command_.arm = scene_.arm;
  command_.epoch = epoch_;
  command_.state_incarnation = state_.incarnation;
  command_.step = state_.step;
  command_.t_s = state_.t_s;
  command_.torque = output_.torque_Nm;
  command_.includes_gravity = false;
  command_.planner_state = mode_ ? wire::PlannerState::idle : to_wire(output_.report.state);
}

void PlannerService::publish_report(Time now, bool always) {
  to_wire(output_.report, report_);
  if (mode_) {
    report_.state = wire::PlannerState::idle;
    report_.reason = wire::Reason::none;
    report_.detail = *mode_ == wire::Mode::stop ? "stopped by a mode command" : "holding by a mode command";
  } else if (looking_) {
    report_.detail = "looking whether the next goal can be reached";
  }
  const bool changed = report_.state != shown_ || report_.reason != shown_reason_;
  if (!always && !changed && now - last_report_ < kReportPeriod) return;
  if (changed)
    spdlog::debug("t = {:.3f} s: {} {}", state_.t_s, wire::to_string(report_.state), report_.detail);
  report_.step = state_.step;
  report_.t_s = state_.t_s;
  report_.obstacle_age_s = obstacle_age_s_;
  report_.cycle_time_s = cycle_s_;
  report_.commands_late = commands_late_;
  report_.caused_by = command_.caused_by;
  send_report(now);
}

void PlannerService::send_report(Time now) {
  shown_ = report_.state;
  shown_reason_ = report_.reason;
  last_report_ = now;
  report_.arm = scene_.arm;
  report_.epoch = epoch_;
  report_.goal_id = looking_ ? planner_.memory().goal_id : goal_ ? goal_->id : 0;
  report_.mode_id = mode_id_;
  report_out_.publish(report_);
}

bool PlannerService::waits_for_obstacles() const {
  return config_.pace == scene::Pace::lockstep && have_state_ && !answered_ && !view_.covers(state_.t_s);
}

std::string PlannerService::whom_it_waits_for() const {
  return fmt::format("step {} waits for perception of arm {}", state_.step, scene_.arm);
}

/// Nothing to plan for: still say so, ten times a second.
void PlannerService::report_silence(Time now) {
  if (now - last_report_ < 100ms || now - last_silence_ < 100ms) return;
  last_silence_ = now;
  const bool lockstep = config_.pace == scene::Pace::lockstep;
  report_.reason = wire::Reason::none;
  if (!have_state_) {
    report_.state = wire::PlannerState::idle;
    report_.detail = "no arm state yet";
  } else if (waits_for_obstacles()) {
    report_.state = wire::PlannerState::idle;
    report_.detail = whom_it_waits_for();
    if (now - unanswered_since_ > 1s && waits_(now)) spdlog::warn("{}", report_.detail);
  } else if (now - last_state_ > topics::kState.stale && !lockstep) {
    report_.state = wire::PlannerState::unsafe;
    report_.reason = wire::Reason::stale_state;
    report_.detail = "the arm's state is stale";
    enter_look(false);  // no cycle comes that it could wait for
  } else {
    return;
  }
  send_report(now);
}

void PlannerService::publish_status(Time now, wire::ServiceState state) {
  presence_.say(now, {.state = state,
                      .incarnation = epoch_,
                      .detail = waits_for_obstacles() ? whom_it_waits_for() : wire::to_string(shown_),
                      .counters = {{"cycles", cycles_},
                                   {"commands_late", commands_late_},
                                   {"states_discarded", states_discarded_},
                                   {"undecodable", state_in_.undecodable() + obstacles_in_.undecodable() +
                                                       goal_in_.undecodable() + mode_in_.undecodable()}}});
}

void PlannerService::close() { publish_status(runtime::Clock::now(), wire::ServiceState::stopping); }

}  // namespace hamel::planner
