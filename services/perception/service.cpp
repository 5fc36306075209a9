#include "services/perception/service.h"

#include <algorithm>
#include <cmath>

#include "common/runtime/options.h"
#include "services/perception/convert.h"

namespace hamel::perception {

using namespace std::chrono_literals;

namespace {
constexpr auto kClockHeard = 200ms;
constexpr std::uint64_t kNever = ~std::uint64_t{0};

std::int64_t number(std::uint64_t k) { return static_cast<std::int64_t>(k); }
}  // namespace

Checked<std::unique_ptr<PerceptionService>> PerceptionService::make(bus::Node& node,
                                                                    const scene::Scene& scene) {
  auto source = Source::make(scene.perception);
  if (!source) return source.error();
  return std::unique_ptr<PerceptionService>(new PerceptionService(node, scene, std::move(source).value()));
}

PerceptionService::PerceptionService(bus::Node& node, const scene::Scene& scene, Source source)
    : arm_(scene.arm),
      source_(std::move(source)),
      sets_out_(node),
      clock_in_(node),
      presence_(node, wire::ServiceKind::perception, scene.arm) {
  set_.source = scene.arm;
  set_.incarnation = 1;
}

bool PerceptionService::poll(Time now) {
  const bool heard = hear_clock(now);
  bool published = false;
  if (clock_ && clock_->running) {
    if (clock_->pace == wire::Pace::lockstep) {
      // One clock message ahead: the next comes after 10 ms of the run, or after one step where that is
      // longer.
      if (heard) published = publish_until(clock_->t_s + std::max(0.01, clock_->dt_s));
    } else {
      published = publish_until(run_time_s(now));
    }
  }
  if (published) count_glitches(now);
  if (now - last_status_ >= 500ms) publish_status(now, wire::ServiceState::ready);
  return heard || published;
}

/// Newest clock message; a repeated one asks for the sets of its time again, a new incarnation starts anew.
bool PerceptionService::hear_clock(Time now) {
  bool heard = false;
  wire::SimulationClock c;
  while (clock_in_.take(c)) {
    if (c.arm != arm_) continue;
    // Two arms of one key: the one that is known stays, as long as it is heard.
    const bus::WriterId from = clock_in_.from();
    if (clock_ && from != clock_writer_ && now - clock_heard_ < kClockHeard) continue;
    clock_writer_ = from;
    const bool again = clock_ && c.incarnation == clock_->incarnation && c.step == clock_->step && c.running;
    const bool anew = !clock_ || c.incarnation != clock_->incarnation || c.step < clock_->step;
    if (again) ++repeated_;
    if (again || anew) next_.reset();
    if (anew && !paused_) behind_ = 0;
    clock_ = c;
    set_.incarnation = c.incarnation;  // sets of an earlier run of the arm are none of this one
    clock_heard_ = now;
    heard = true;
  }
  return heard;
}

/// The run's time now, carried on from the last clock message for as long as that is not stale.
double PerceptionService::run_time_s(Time now) const {
  const double since_s = std::chrono::duration<double>(now - clock_heard_).count();
  const double stale_s = std::chrono::duration<double>(topics::kClock.stale).count();
  return clock_->t_s + (since_s < stale_s ? since_s : 0);
}

bool PerceptionService::publish_until(double t_s) {
  const bool lockstep = clock_->pace == wire::Pace::lockstep;
  const auto number_at = [this](double t) {
    return static_cast<std::uint64_t>(std::floor(std::max(0.0, t) / source_.period_s() + 1e-9));
  };
  if (!next_) next_ = number_at(clock_->t_s);
  // A long silence is skipped in real time, not made up for in a burst.
  if (!lockstep && number_at(t_s) > *next_ + 4) next_ = number_at(t_s);
  bool any = false;
  while (*next_ != kNever && static_cast<double>(*next_) * source_.period_s() <= t_s) {
    const bool promise = lockstep && !controlled_;
    any |= publish_set(*next_, promise);
    next_ = promise ? after(*next_) : *next_ + 1;
  }
  return any;
}

bool PerceptionService::publish_set(std::uint64_t k, bool promise) {
  const bool stands = paused_ && steps_ == 0;
  if (paused_ && steps_ > 0) --steps_, ++shown_;
  if (!paused_) shown_ = std::max(number(k) - behind_, number(0));
  behind_ = number(k) - shown_;
  if (!to_wire(source_, k, static_cast<std::uint64_t>(shown_), promise, set_)) return false;
  if (stands)
    for (geometry::Obstacle& o : set_.obstacles) o.V_WO.setZero(), o.velocity_known = true;
  ++published_;
  return sets_out_.publish(set_);
}

void PerceptionService::pause(bool on) {
  if (controlled_ && paused_ == on) return;
  controlled_ = true;
  paused_ = on;
  steps_ = 0;
}

void PerceptionService::step() {
  if (paused_) ++steps_;
}

/// The number of the set that follows number k where something changes; kNever when nothing will.
std::uint64_t PerceptionService::after(std::uint64_t k) const {
  const double next_s = source_.next_time(static_cast<double>(k) * source_.period_s());
  if (!std::isfinite(next_s)) return kNever;
  return std::max(k + 1, static_cast<std::uint64_t>(std::llround(next_s / source_.period_s())));
}

runtime::Clock::time_point PerceptionService::due() const {
  if (!clock_ || !clock_->running || clock_->pace == wire::Pace::lockstep || !next_ ||
      runtime::Clock::now() - clock_heard_ > topics::kClock.stale)
    return last_status_ + 500ms;
  const double wait_s = static_cast<double>(*next_) * source_.period_s() - clock_->t_s;
  return std::min(clock_heard_ + runtime::seconds(wait_s), last_status_ + 500ms);
}

/// Wrong samples of the stream, once the world has come by them.
void PerceptionService::count_glitches(Time now) {
  const std::uint64_t passed = source_.glitches(shown_s());
  if (passed > glitches_ && glitch_log_(now))
    spdlog::warn("{:.3f} s: {} wrong samples of the stream passed over so far", shown_s(), passed);
  glitches_ = passed;
}

void PerceptionService::publish_status(Time now, wire::ServiceState state) {
  last_status_ = now;
  presence_.say(now, {.state = state,
                      .incarnation = set_.incarnation,
                      .detail = source_.is_static() ? "static obstacles" : "moving obstacles",
                      .counters = {{"sets", published_},
                                   {"repeated", repeated_},
                                   {"glitches", glitches_},
                                   {"undecodable", clock_in_.undecodable()}}});
}

void PerceptionService::close() { publish_status(runtime::Clock::now(), wire::ServiceState::stopping); }

}  // namespace hamel::perception
