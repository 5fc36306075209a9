/// Whom the dynamics service hears: one planner of several, and whether it may stay beside another arm of its
/// key.

#include "services/dynamics/service.h"

namespace hamel::dynamics {

using namespace std::chrono_literals;

namespace {
constexpr auto kYoung = 3s;  // so long a new arm gives way to one that is there
constexpr auto kPause = 1s;  // who was away for longer is new again
}  // namespace

/// Two arms of one key on one domain: the one that has run longer stays, the new one ends.  Of two that are
/// new the smaller incarnation stays, of equals the smaller writer id.
void DynamicsService::meet_other_arms(Time now) {
  if (now - last_poll_ > kPause || young_until_ == Time{})
    young_until_ = now + kYoung;  // stopped for a while: others may have come
  last_poll_ = now;
  wire::SimulationClock c;
  while (clock_in_.take(c)) {
    const bus::WriterId from = clock_in_.from(), own = clock_out_.id();
    if (c.arm != scene_.arm || from == own || !c.running) continue;
    if (now > young_until_) {
      if (refusals_(now))
        spdlog::warn("another arm {} speaks on this domain; this one was here before", c.arm);
    } else if (incarnation_ > c.incarnation || (incarnation_ == c.incarnation && own > from)) {
      end(Outcome::not_alone,
          fmt::format(
              "arm {} runs already on this domain (t = {:.3f} s): another --domain, or another arm in the "
              "scene",
              c.arm, c.t_s));
      return;
    }
  }
}

void DynamicsService::take_commands() {
  while (command_in_.take(incoming_)) {
    if (incoming_.arm != scene_.arm) continue;
    if (!fits(incoming_) || !owns(incoming_) || (command_step_ && incoming_.step <= *command_step_)) {
      ++commands_refused_;
      continue;
    }
    // What was never driven is at rest where the run begins: it starts at once, as in lockstep.
    if (state_.caused_by.size == 0) driven_from_ = step_now() - ramp_steps();
    command_ = incoming_.torque;
    command_step_ = incoming_.step;
    command_includes_gravity_ = incoming_.includes_gravity;
    planner_state_ = incoming_.planner_state;
    state_.caused_by.size = 0;
    state_.caused_by.add(wire::ServiceKind::planner, incoming_.step);
  }
}

/// A command must be of our size and answer a state of this incarnation that was published, and in real time
/// one that is not stale yet.
bool DynamicsService::fits(const wire::TorqueCommand& c) {
  if (c.torque.size() != command_.size()) {
    if (refusals_(runtime::Clock::now()))
      spdlog::warn("command for {} joints refused: arm {} has {}", c.torque.size(), scene_.arm,
                   command_.size());
    return false;
  }
  if (c.state_incarnation != incarnation_ || c.step > arm_.state().step) return false;
  const double age_s = static_cast<double>(arm_.state().step - c.step) * scene_.dynamics.dt_s;
  return config_.pace == scene::Pace::lockstep || age_s <= command_stale_s();
}

/// One planner drives the arm: the one with the largest epoch, of equals the one that has it.  Any other may
/// take over once that one is silent.
bool DynamicsService::owns(const wire::TorqueCommand& c) {
  const bus::WriterId from = command_in_.from();
  const bool stronger = from == owner_ ? c.epoch >= epoch_ : c.epoch > epoch_;
  if (!stronger && !owner_is_silent()) {
    if (from != owner_ && refusals_(runtime::Clock::now()))
      spdlog::warn("another planner commands arm {} (epoch {}): refused, the one with epoch {} has it",
                   scene_.arm, c.epoch, epoch_);
    return false;
  }
  if (from != owner_) {
    if (command_step_) spdlog::info("the planner with epoch {} takes arm {} over", c.epoch, scene_.arm);
    driven_from_.reset();
  }
  owner_ = from;
  epoch_ = c.epoch;
  return true;
}

/// True when the planner that holds the arm has not been heard for longer than a command stays fresh: another
/// may take over, whatever its epoch.
bool DynamicsService::owner_is_silent() const {
  if (!command_step_) return true;
  if (config_.pace == scene::Pace::lockstep) return runtime::Clock::now() - waiting_since_ > 1s;
  return command_age_s() > command_stale_s();
}

double DynamicsService::command_age_s() const {
  return static_cast<double>(arm_.state().step - *command_step_) * scene_.dynamics.dt_s;
}

double DynamicsService::command_stale_s() const {
  return std::max(std::chrono::duration<double>(topics::kCommand.stale).count(),
                  3 * scene_.planner.period_steps * scene_.dynamics.dt_s);
}

}  // namespace hamel::dynamics
