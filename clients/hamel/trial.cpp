#include "clients/hamel/trial.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/rbd/rbd.h"
#include "services/dynamics/arm.h"
#include "services/perception/core/source.h"
#include "services/planner/core/escape.h"

namespace hamel::client {

namespace {

constexpr double kPatience_s = 20;  // for one goal of a cycle
constexpr double kFirstBin_s = 1e-8, kBinRatio = 1.08;

/// Distance to the goal as the user means it, from the arm's state alone.
class Arrival {
 public:
  explicit Arrival(const scene::Scene& s) : goal(*s.goal), scene_(s), ws_(s.robot.chain) {}

  /// True once the goal has been held long enough.
  bool update(double t_s, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
    const scene::PlannerOptions& o = scene_.planner;
    rbd::velocities(scene_.robot.chain, q, qd, ws_);
    const lie::Pose X_WE = rbd::tip(scene_.robot.chain, ws_);
    if (known_) path_m += (X_WE.p - tip_).norm();
    known_ = true;
    tip_ = X_WE.p;
    const lie::Twist& V_B = ws_.V_B.back();
    const lie::Pose& X_WB = ws_.X_WB.back();
    double speed = (X_WB.R * (V_B.tail<3>() + V_B.head<3>().cross(scene_.robot.chain.X_NE().p))).norm();
    bool within = false;
    if (goal.kind == scene::GoalKind::joints) {
      error_m = (goal.joints - q).lpNorm<Eigen::Infinity>();
      within = error_m <= o.goal_tolerance_joint;
      speed = qd.lpNorm<Eigen::Infinity>();
    } else {
      error_m = (goal.X_WG.p + (t_s - begun_s) * goal.V_WG.tail<3>() - tip_).norm();
      within = error_m <= o.goal_tolerance_m;
      if (goal.kind == scene::GoalKind::pose)
        within &= Eigen::AngleAxisd(goal.X_WG.R * X_WE.R.transpose()).angle() <= o.goal_tolerance_rad;
    }
    if (!(within && speed < o.goal_speed))
      since_s = -1;
    else if (since_s < 0)
      since_s = t_s;
    return since_s >= 0 && t_s - since_s >= o.goal_hold_s;
  }

  /// From now on another goal.
  void aim(const scene::Goal& next, double t_s) {
    goal = next;
    since_s = -1;
    begun_s = t_s;
  }

  scene::Goal goal;
  double error_m = 0, path_m = 0, since_s = -1, begun_s = 0;

 private:
  const scene::Scene& scene_;
  rbd::Workspace ws_;
  Eigen::Vector3d tip_ = Eigen::Vector3d::Zero();
  bool known_ = false;
};

/// What the planner is told of the obstacles, and how old it is.
class Senses {
 public:
  Senses(const perception::Source& source, const TrialOptions& options) : source_(source), options_(options) {
    seen_.reserve(source.most_obstacles());
  }
  void look(double now_s) {
    const double t_s = std::max(std::min(now_s, options_.dropout_s) - options_.latency_s, 0.0);
    if (options_.perfect_perception) {
      const double rate_hz = options_.rate_hz;
      const double stamp_s = rate_hz > 0 ? std::floor(t_s * rate_hz + 1e-9) / rate_hz : t_s;
      source_.at(stamp_s, seen_);
      age_s = now_s - stamp_s;
    } else {
      while (next_s_ <= t_s + 1e-12) {
        if (source_.at(next_s_, seen_)) stamp_s_ = next_s_;
        next_s_ = source_.next_time(next_s_);
      }
      age_s = source_.is_static() ? 0 : now_s - stamp_s_;
    }
    if (!options_.velocities_known)
      for (geometry::Obstacle& o : seen_) o.velocity_known = false;
  }
  const std::vector<geometry::Obstacle>& seen() const { return seen_; }
  double age_s = 0;

 private:
  const perception::Source& source_;
  const TrialOptions& options_;
  std::vector<geometry::Obstacle> seen_;
  double stamp_s_ = 0, next_s_ = 0;
};

class Run {
 public:
  Run(const scene::Scene& scene, const TrialOptions& options, const perception::Source& source)
      : scene_(scene),
        options_(options),
        source_(source),
        senses_(source, options),
        arm_(scene),
        planner_(scene.robot, scene.planner),
        out_(planner_.output()),
        judge_(scene.robot),
        arrival_(scene) {
    if (!options.cycle.empty()) arrival_.aim(options.cycle.front(), 0);
    planner_.set_goal(arrival_.goal);
    truth_.reserve(source.most_obstacles());
    qd_before_ = scene.qd0;
    qdd_before_ = Eigen::VectorXd::Zero(scene.qd0.size());
  }

  Trial run() {
    const auto steps = static_cast<std::uint64_t>(std::llround(scene_.duration_s / scene_.dynamics.dt_s));
    const auto every = static_cast<std::uint64_t>(scene_.planner.period_steps);
    for (std::uint64_t k = 0; k <= steps && !over_; ++k) {
      if (observe()) break;
      if (k % every == 0) plan();
      if (k == steps || (k % 64 == 0 && options_.stop && options_.stop())) break;
      const dynamics::Drive drive{dynamics::DriveKind::torque, &out_.torque_Nm, false};
      if (!arm_.advance(drive)) {
        trial_.ending = Ending::failed;
        over_ = true;
      }
      trial_.saturated_steps += arm_.torque_saturated();
      sum_variation();
    }
    if (!over_)
      trial_.ending = out_.report.state == planner::State::stuck ? Ending::stuck : Ending::timed_out;
    trial_.end_s = arm_.t_s();
    trial_.path_m = arrival_.path_m;
    trial_.error_m = arrival_.error_m;
    trial_.clearance_min_m = judge_.clearance_min_m();
    trial_.reason = out_.report.reason;
    if (trial_.end_s > 0) trial_.jerkiness /= trial_.end_s;
    return std::move(trial_);
  }

 private:
  // The truth at this state: touched, or arrived.  True where that ends the trial.
  bool observe() {
    const double t_s = arm_.t_s();
    if (!source_.at(t_s, truth_)) truth_.clear();
    const Contact* c = judge_.advance(t_s, arm_.state().q, truth_);
    const bool arrived = arrival_.update(t_s, arm_.state().q, arm_.state().qd);
    if (!options_.cycle.empty()) return count(c, arrived), false;
    if (t_s >= options_.dropout_s && !c) return over_ = watch_stop(t_s);
    if (c) {
      trial_.contact = *c;
      trial_.ending = Ending::collided;
      plan();
      trial_.contact_reported = out_.report.reason == planner::Reason::contact;
    } else if (arrived) {
      trial_.ending = Ending::reached;
      trial_.time_s = arrival_.since_s;
    }
    return over_ = c || arrived;
  }

  // How the arm stops once nothing is told any more.  True when it has been watched for long enough.
  bool watch_stop(double t_s) {
    const double speed = arm_.state().qd.lpNorm<Eigen::Infinity>();
    if (!trial_.dropout) trial_.dropout = Dropout{.speed_radps = speed};
    Dropout& d = *trial_.dropout;
    if (!(senses_.age_s > scene_.planner.stale_brake_s)) {
      stale_s_ = t_s;
      d.stale_speed_radps = speed;
      d.least_s = least_stop_s();
    } else if (speed >= kStill_radps) {
      d.stop_s = t_s + scene_.dynamics.dt_s - stale_s_;
    }
    trial_.ending = Ending::timed_out;
    return t_s - options_.dropout_s > scene_.planner.stale_brake_s + kWatched_s;
  }

  // The joint that needs longest to lose its momentum by its own torque.
  double least_stop_s() {
    const model::Chain& chain = scene_.robot.chain;
    const Eigen::VectorXd& q = arm_.state().q;
    Eigen::MatrixXd M(chain.n(), chain.n());
    rbd::Workspace ws(chain);
    rbd::positions(chain, q, ws);
    rbd::mass_matrix(chain, ws, M);
    Eigen::VectorXd weight(chain.n());
    rbd::gravity_torque(chain, ws, weight);
    const Eigen::VectorXd p = M * arm_.state().qd, still = M.cwiseAbs().rowwise().sum() * kStill_radps;
    double longest_s = 0;
    for (int i = 0; i < chain.n(); ++i) {
      const double room_Nm = chain.joint(i).limits.effort - std::abs(weight[i]);
      longest_s = std::max(longest_s, (std::abs(p[i]) - still[i]) / std::max(room_Nm, 0.0));
    }
    return longest_s;
  }

  // Contacts and goals of a cycle.
  void count(const Contact* c, bool arrived) {
    if (c && !touching_) {
      ++(c->arm_caused ? trial_.contacts_by_arm : trial_.contacts_by_others);
      if (!trial_.contact || c->arm_caused) trial_.contact = *c;
    }
    touching_ = c != nullptr;
    if (!arrived && arm_.t_s() - arrival_.begun_s < kPatience_s) return;
    ++(arrived ? trial_.goals_reached : trial_.goals_missed);
    scene::Goal next = options_.cycle[++goals_ % options_.cycle.size()];
    next.id = goals_ + 1;
    arrival_.aim(next, arm_.t_s());
    planner_.set_goal(next);
  }

  void plan() {
    const double t_s = arm_.t_s();
    senses_.look(t_s);
    const planner::Input in{.step = arm_.state().step,
                            .t_s = t_s,
                            .dt_s = scene_.planner.period_steps * scene_.dynamics.dt_s,
                            .q = arm_.state().q,
                            .qd = arm_.state().qd,
                            .obstacles = senses_.seen(),
                            .obstacle_age_s = senses_.age_s};
    if (escape_due_ && in.step >= *escape_due_) {
      planner_.take_escape(escape_.waypoint, t_s);
      escape_due_.reset();
    }
    const double began_s = options_.now_s ? options_.now_s() : 0;
    planner_.plan(in, out_);
    if (options_.now_s) trial_.cycle.add(options_.now_s() - began_s);
    ++trial_.cycles;
    if (trial_.dropout && senses_.age_s > scene_.planner.stale_brake_s)
      trial_.dropout->told &= out_.report.reason == planner::Reason::stale_obstacles &&
                              out_.report.state == planner::State::unsafe;
    if (in.step == 0 && options_.by_way_of.size() > 0) planner_.take_escape(options_.by_way_of, t_s);
    trial_.unsafe_cycles += out_.report.state == planner::State::unsafe;
    trial_.unreported_contacts += touching_ && out_.report.reason != planner::Reason::contact;
    if (out_.report.escape_asked) {
      escape_ = planner::find_escape(scene_.robot, scene_.planner, planner_.escape_question(in));
      escape_due_ = in.step + planner_.escape_steps(scene_.dynamics.dt_s);
    }
    trial_.infeasible_cycles += out_.report.reason == planner::Reason::infeasible;
  }

  void sum_variation() {
    qdd_ = (arm_.state().qd - qd_before_) / scene_.dynamics.dt_s;
    if (arm_.state().step > 1) trial_.jerkiness += (qdd_ - qdd_before_).lpNorm<1>();
    qd_before_ = arm_.state().qd;
    qdd_before_ = qdd_;
  }

  const scene::Scene& scene_;
  const TrialOptions& options_;
  const perception::Source& source_;
  Senses senses_;
  dynamics::Arm arm_;
  planner::Planner planner_;
  planner::Output out_;
  planner::Escape escape_;
  std::optional<std::uint64_t> escape_due_;
  Judge judge_;
  Arrival arrival_;
  std::vector<geometry::Obstacle> truth_;
  Eigen::VectorXd qd_before_, qdd_before_, qdd_;
  Trial trial_;
  std::uint64_t goals_ = 0;
  double stale_s_ = 0;  // the last time at which what was told was not yet stale
  bool over_ = false, touching_ = false;
};

}  // namespace

void Durations::add(double s) noexcept {
  const double bin = std::log(std::max(s, kFirstBin_s) / kFirstBin_s) / std::log(kBinRatio);
  ++bins_[std::min(static_cast<std::size_t>(bin), bins_.size() - 1)];
  ++count_;
}

void Durations::add(const Durations& other) noexcept {
  for (std::size_t i = 0; i < bins_.size(); ++i) bins_[i] += other.bins_[i];
  count_ += other.count_;
}

double Durations::quantile(double part) const noexcept {
  if (count_ == 0) return std::numeric_limits<double>::quiet_NaN();
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    below += bins_[i];
    if (static_cast<double>(below) >= part * static_cast<double>(count_))
      return kFirstBin_s * std::pow(kBinRatio, static_cast<double>(i + 1));
  }
  return kFirstBin_s * std::pow(kBinRatio, static_cast<double>(bins_.size()));
}

const char* to_string(Ending v) {
  static constexpr std::array names{"reached", "collision", "stuck", "timeout", "failed"};
  return names[static_cast<std::size_t>(v)];
}

Trial run_trial(const scene::Scene& scene, const TrialOptions& options) {
  const auto source = perception::Source::make(scene.perception);
  if (!source || !scene.goal) return {};  // problems(scene) would have said so
  return Run(scene, options, source.value()).run();
}

}  // namespace hamel::client
