#include "clients/hamel/monitor.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "common/runtime/options.h"

namespace hamel::client {

using namespace std::chrono_literals;

namespace {
constexpr auto kPatience = 20s;     // nothing heard for so long: the run is lost
constexpr auto kLastWords = 500ms;  // after the final summary, for the last report
constexpr auto kHeard = 200ms;      // so long after its last word no other of the same arm is heard
constexpr std::size_t kRowsWaiting = 200;
constexpr std::size_t kMostOutages = 1000;
}  // namespace

Result<std::unique_ptr<CsvWriter>, Problem> CsvWriter::open(const std::string& path, int n, bool steered) {
  std::unique_ptr<CsvWriter> w(new CsvWriter);
  w->path_ = path;
  w->file_ = std::fopen(path.c_str(), "w");
  if (!w->file_) return Problem{path, std::string("cannot write: ") + std::strerror(errno)};
  std::string header = "t_s";
  for (const char* name : {"q", "qd", "tau_Nm"})
    for (int i = 0; i < n; ++i) header += fmt::format(",{}{}", name, i + 1);
  header += ",ee_x_m,ee_y_m,ee_z_m,clearance_m,energy_J,work_J,iterations,residual_Nm";
  if (steered) {
    header +=
        ",state,reason,target_error_m,kinetic_J,attraction_J,tank_J,gyroscopic_power_W,injected_power_W,"
        "self_clearance_m,barrier_rows,cycle_time_s";
    for (int i = 1; i <= n; ++i)
      header += fmt::format(
          ",obstacle{0},distance_m{0},closing_mps{0},gate{0},gyroscopic_N{0},repulsive_N{0},barrier_N{0}", i);
  }
  header += "\n";
  w->links_ = steered ? n : 0;
  std::fputs(header.c_str(), w->file_);
  return w;
}

CsvWriter::~CsvWriter() {
  if (file_) std::fclose(file_);
}

void CsvWriter::row(const wire::ArmState& s, const Eigen::Vector3d& tip_m, const wire::PlannerReport& r) {
  fmt::memory_buffer b;
  const auto out = std::back_inserter(b);
  fmt::format_to(out, "{:.9g}", s.t_s);
  for (const auto* v : {&s.position, &s.velocity, &s.torque_applied})
    for (Eigen::Index i = 0; i < v->size(); ++i) fmt::format_to(out, ",{:.17g}", (*v)[i]);
  fmt::format_to(out, ",{:.9g},{:.9g},{:.9g},{:.9g},{:.17g},{:.17g},{},{:.3g}", tip_m.x(), tip_m.y(),
                 tip_m.z(), r.clearance_m, s.energy_J, s.work_J, s.solver.iterations, s.solver.residual_Nm);
  if (links_ > 0) report(r, out);
  b.push_back('\n');
  failed_ |= std::fwrite(b.data(), 1, b.size(), file_) != b.size();
}

/// What the planner thought.
void CsvWriter::report(const wire::PlannerReport& r,
                       std::back_insert_iterator<fmt::memory_buffer> out) const {
  fmt::format_to(out, ",{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.9g},{},{:.3g}",
                 wire::to_string(r.state), wire::to_string(r.reason), r.target_error_m, r.kinetic_J,
                 r.attraction_J, r.tank_J, r.gyroscopic_power_W, r.injected_power_W, r.self_clearance_m,
                 r.barrier_rows, r.cycle_time_s);
  for (std::size_t i = 0; i < static_cast<std::size_t>(links_); ++i) {
    if (i >= r.links.size() || !std::isfinite(r.links[i].distance_m)) {
      fmt::format_to(out, ",,inf,0,0,0,0,0");  // nothing near
      continue;
    }
    const wire::LinkReport& l = r.links[i];
    fmt::format_to(out, ",{},{:.9g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}", l.obstacle, l.distance_m,
                   l.closing_speed_mps, l.gate, l.gyroscopic_N.norm(), l.repulsive_N.norm(),
                   l.barrier_multiplier);
  }
}

std::optional<Problem> CsvWriter::finish() {
  failed_ |= std::fflush(file_) != 0;
  if (failed_) return Problem{path_, "could not be written whole: is the disk full?"};
  return std::nullopt;
}

bool Heard::takes(const bus::WriterId& from, runtime::Clock::time_point now, bool continues) {
  if (writer_ && from != *writer_ && !continues) {
    other_ = from;
    return false;
  }
  writer_ = from;
  last_ = now;
  return true;
}

void Heard::settle(runtime::Clock::time_point now) {
  if (other_ && now - last_ > kHeard) writer_ = other_;
  other_.reset();
}

Monitor::Monitor(bus::Node& node, const scene::Scene& scene, scene::Pace pace, std::unique_ptr<CsvWriter> csv,
                 bool live)
    : scene_(scene),
      pace_(pace),
      state_in_(node),
      report_in_(node),
      summary_in_(node),
      csv_(std::move(csv)),
      live_(live && isatty(STDERR_FILENO)),
      ws_(scene.robot.chain),
      began_(runtime::Clock::now()),
      last_heard_(began_),
      last_shown_(began_),
      ended_(began_) {}

bool Monitor::poll(Time now) {
  const auto before = states_ + reports_;
  take_reports(now);
  take_states(now);
  take_summaries(now);
  write_rows(false);
  const bool heard = states_ + reports_ != before;
  if (heard) last_heard_ = now;
  show(now);

  if (!finished_ && summary_ && summary_->final_summary) {
    // In real time the planner reports each 10 ms, not each step.
    const bool lockstep = pace_ == scene::Pace::lockstep;
    const bool last_report = !scene_.steered || !lockstep || (report_ && report_->step >= summary_->steps);
    finished_ = last_report || now - final_heard_ > kLastWords;
  }
  if (!finished_ && now - last_heard_ > kPatience) finished_ = true;
  if (finished_) {
    ended_ = now;
    write_rows(true);
    if (live_) std::fputs("\r\033[K", stderr);
  }
  return heard;
}

runtime::Clock::time_point Monitor::due() const {
  return std::min(last_shown_ + 250ms,
                  summary_ && summary_->final_summary ? final_heard_ + kLastWords : last_shown_ + 250ms);
}

void Monitor::outage(const char* service, double t_s, double length_s) {
  if (outages_.size() < kMostOutages)
    outages_.push_back({service, t_s, length_s});
  else
    ++outages_more_;
}

/// Real time: who fell silent for longer than its topic allows, and how long.  Called with each new state.
void Monitor::follow(const wire::ArmState& s, Time now) {
  if (pace_ != scene::Pace::realtime) return;
  if (state_ && now - last_state_ > topics::kState.stale)
    outage("dynamics", s.t_s, std::chrono::duration<double>(now - last_state_).count());
  last_state_ = now;
  const bool silent = s.validity == wire::Validity::command_stale;
  if (silent && !silent_since_s_) silent_since_s_ = s.t_s;
  if (!silent && silent_since_s_) {
    outage("planner", *silent_since_s_, s.t_s - *silent_since_s_);
    silent_since_s_.reset();
  }
}

void Monitor::take_states(Time now) {
  wire::ArmState s;
  while (state_in_.take(s)) {
    if (s.arm != scene_.arm || s.position.size() != scene_.robot.chain.n()) continue;
    const bool same = state_ && s.incarnation == state_->incarnation;
    // Started again, it goes on: in lockstep, where all count their incarnations from one, with the next
    // step.
    const bool continues = same && (pace_ == scene::Pace::realtime || s.step - state_->step <= 1);
    if (!arm_.takes(state_in_.from(), now, continues)) continue;
    if (same && s.step <= state_->step) continue;  // repeated
    if (same) rows_lost_ += s.step - state_->step - 1;
    if (state_ && !same) begin_anew();
    ++states_;
    follow(s, now);
    state_ = s;
    if (csv_) rows_.push_back(s);
  }
  arm_.settle(now);
}

/// Another incarnation: its time is not that of the one before.
void Monitor::begin_anew() {
  silent_since_s_.reset();
  blind_since_s_.reset();
  summary_.reset();
}

/// Of the arm that is followed.
void Monitor::take_summaries(Time now) {
  wire::RunSummary s;
  while (summary_in_.take(s)) {
    if (s.arm != scene_.arm || (state_ && s.incarnation != state_->incarnation)) continue;
    if (s.final_summary && !(summary_ && summary_->final_summary)) final_heard_ = now;
    summary_ = s;
    last_heard_ = now;
  }
}

void Monitor::take_reports(Time now) {
  wire::PlannerReport r;
  while (report_in_.take(r)) {
    if (r.arm != scene_.arm || !planner_.takes(report_in_.from(), now)) continue;
    // When the run is over the planner hears no more states and says so: that is not how the run went.
    if (summary_ && summary_->final_summary && r.reason == wire::Reason::stale_state) continue;
    ++reports_;
    const bool blind = r.state == wire::PlannerState::unsafe && r.reason == wire::Reason::stale_obstacles;
    if (blind && !blind_since_s_) blind_since_s_ = r.t_s;
    if (!blind && blind_since_s_) {
      if (report_) outage("perception", *blind_since_s_, r.t_s - *blind_since_s_);
      blind_since_s_.reset();
    }
    clearance_min_m_ = std::min(clearance_min_m_, r.clearance_min_m);
    contacts_ = std::max(contacts_, r.contacts);
    report_ = std::move(r);
    write_rows(false);
  }
  planner_.settle(now);
}

/// A row waits for the report of its step: states and reports come from different writers.
void Monitor::write_rows(bool all) {
  if (!csv_) return;
  while (!rows_.empty()) {
    const wire::ArmState& s = rows_.front();
    const bool ready =
        all || !scene_.steered || (report_ && report_->step >= s.step) || rows_.size() > kRowsWaiting;
    if (!ready) return;
    rbd::positions(scene_.robot.chain, s.position, ws_);
    csv_->row(s, rbd::tip(scene_.robot.chain, ws_).p, report_ ? *report_ : wire::PlannerReport{});
    rows_.pop_front();
  }
}

/// One line, rewritten in place four times a second.
void Monitor::show(Time now) {
  if (now - last_shown_ < 250ms) return;
  const double dt_s = std::chrono::duration<double>(now - last_shown_).count();
  if (live_ && state_) {
    const double drift = summary_ ? summary_->energy_drift_rel : 0;
    std::string line =
        fmt::format("t={:.1f}s {:.2f}x dyn {:.0f}Hz", state_->t_s, (state_->t_s - shown_t_s_) / dt_s,
                    static_cast<double>(states_ - shown_states_) / dt_s);
    if (report_)
      line += fmt::format(" plan {:.0f}us {} error {:.3f}m clearance {:.3f}m", report_->cycle_time_s * 1e6,
                          wire::to_string(report_->state), report_->target_error_m, report_->clearance_m);
    line += fmt::format(" dE/E {:.0e}", drift);
    if (restarts_ > 0) line += fmt::format(" restarts {}", restarts_);
    line += fmt::format(" unseen {}", rows_lost_);
    fmt::print(stderr, "\r\033[K{}", line);
    std::fflush(stderr);
  }
  last_shown_ = now;
  shown_t_s_ = state_ ? state_->t_s : 0;
  shown_states_ = states_;
}

namespace {

/// Names the end of a run and its exit code (agreements: "Command line").
void judge(Outcome& o, const scene::Scene& scene, const wire::PlannerReport* last) {
  const auto say = [&](const char* outcome, std::string reason, int code) {
    o.outcome = outcome;
    o.reason = std::move(reason);
    o.exit_code = code;
  };
  if (o.summary.outcome == "diverged") return say("FAULT", "diverged", runtime::kFailed);
  if (o.summary.outcome == "no_command") return say("NO_DATA", "no_command", runtime::kNoData);
  if (!scene.steered) return say("DONE", "", runtime::kDone);
  if (!last) return say("NO_DATA", "no_report", runtime::kNoData);
  if (o.contacts > 0) return say("UNSAFE", wire::to_string(wire::Reason::contact), runtime::kFailed);
  const std::string reason = last->reason == wire::Reason::none ? "" : wire::to_string(last->reason);
  switch (last->state) {
    case wire::PlannerState::reached:
      return say("REACHED", reason, runtime::kDone);
    case wire::PlannerState::stuck:
    case wire::PlannerState::unsafe:
    case wire::PlannerState::fault:
      return say(wire::to_string(last->state), reason, runtime::kFailed);
    default:
      return say(wire::to_string(last->state), "not_reached_in_time", runtime::kNoData);
  }
}

}  // namespace

Outcome Monitor::outcome(bool interrupted) {
  Outcome o;
  if (!finished_) ended_ = runtime::Clock::now();
  write_rows(true);
  if (live_) std::fputs("\r\033[K", stderr);
  o.wall_s = std::chrono::duration<double>(ended_ - began_).count();
  o.t_s = state_ ? state_->t_s : 0;
  if (summary_) o.summary = *summary_;
  o.contacts = contacts_;
  o.min_clearance_m = clearance_min_m_;
  o.rows_lost = rows_lost_;
  o.restarts = restarts_;
  o.outages = outages_;
  o.outages_more = outages_more_;
  if (report_) {
    o.detail = report_->detail;
    o.time_to_goal_s = report_->time_to_goal_s;
    o.final_error_m = report_->target_error_m;
    o.path_length_m = report_->path_length_m;
  }
  if (!summary_ || !state_) {
    o.outcome = "NO_DATA";
    o.reason = state_ ? "no_summary" : "no_state";
    o.exit_code = runtime::kNoData;
  } else {
    judge(o, scene_, report_ ? &*report_ : nullptr);
    if (!o.summary.final_summary && !interrupted) {
      o.outcome = "NO_DATA";
      o.reason = "the run went silent";
      o.exit_code = runtime::kNoData;
    }
  }
  if (interrupted) {
    o.outcome = "INTERRUPTED";
    o.exit_code = runtime::kInterrupted;
  }
  return o;
}

}  // namespace hamel::client
