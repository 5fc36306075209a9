#include "clients/hamel/ticks.h"

#include <cmath>

#include "services/perception/convert.h"

namespace hamel::client {

namespace {

constexpr std::uint64_t kNever = ~std::uint64_t{0};

}  // namespace

Ticks::Ticks(const scene::Scene& scene)
    : scene_(scene),
      arm_(scene_),
      cadence_(scene_),
      planner_(scene_.robot, scene_.planner, planner::savings(scene_)),
      output_(planner_.output()),
      view_(scene_),
      last_step_(static_cast<std::uint64_t>(std::llround(scene.duration_s / scene.dynamics.dt_s))) {
  if (!scene.steered) return;
  auto source = perception::Source::make(scene.perception);
  if (source) source_ = std::move(source).value();
  if (scene.goal) planner_.set_goal(*scene.goal);
}

/// Hands over the sets that are due now, as perception does in lockstep.
void Ticks::look(double t_s) {
  const double period_s = source_->period_s();
  while (next_set_ != kNever && static_cast<double>(next_set_) * period_s <= t_s) {
    if (perception::to_wire(*source_, next_set_, next_set_, true, set_)) view_.add(set_);
    const double next_s = source_->next_time(static_cast<double>(next_set_) * period_s);
    next_set_ = std::isfinite(next_s)
                    ? std::max(next_set_ + 1, static_cast<std::uint64_t>(std::llround(next_s / period_s)))
                    : kNever;
  }
}

void Ticks::plan(const dynamics::State& s, double t_s) {
  if (!scene_.steered || !source_ || !cadence_.due(s.step, s.q, s.qd)) return;
  look(t_s);
  causes_.size = 0;
  const double age_s = view_.at(t_s, s.q, causes_);
  planner::Input in{.step = s.step,
                    .t_s = t_s,
                    .dt_s = scene_.planner.period_steps * scene_.dynamics.dt_s,
                    .q = s.q,
                    .qd = s.qd,
                    .obstacles = view_.obstacles(),
                    .obstacle_age_s = age_s,
                    .obstacle_set = view_.set(),
                    .obstacles_expected = true,
                    .link_floor_m = view_.link_floor_m()};
  if (escape_due_ && s.step >= *escape_due_) {
    planner_.take_escape(escape_.waypoint, t_s);
    escape_due_.reset();
  }
  planner_.plan(in, output_);
  if (!output_.report.escape_asked) return;
  in.obstacles = view_.all();
  escape_ = planner::find_escape(scene_.robot, scene_.planner, planner_.escape_question(in));
  escape_due_ = s.step + planner_.escape_steps(scene_.dynamics.dt_s);
}

bool Ticks::step() {
  dynamics::Drive drive;
  if (scene_.steered) drive = {dynamics::DriveKind::torque, &output_.torque_Nm, false};
  return arm_.advance(drive);
}

bool Ticks::done() const {
  if (arm_.state().step >= last_step_) return true;
  return scene_.stop == scene::StopRule::when_reached && scene_.steered &&
         output_.report.state == planner::State::reached;
}

}  // namespace hamel::client
