/// What a restart of the planner service resumes from, and how.

#include <fmt/format.h>

#include "services/planner/service.h"

namespace hamel::planner {

namespace {

constexpr std::uint32_t kKind = 0x0205;  // planner, layout 5

struct SavedGoal {
  std::uint64_t id = 0, kind = 0;
  std::array<double, 12> pose{};
  std::array<double, 6> twist{};
};

struct SavedObstacle {
  std::uint32_t id = 0, kind = 0, velocity_known = 0, unused = 0;
  std::array<double, 3> dims_m{};
  std::array<double, 12> pose{};
  std::array<double, 6> twist{};
  double sigma_m = 0, seen_s = 0;
};

constexpr std::size_t kCapacity = sizeof(Memory) + 16384 + Obstacles::kMost * sizeof(SavedObstacle);

void put(std::array<double, 12>& out, const lie::Pose& X) {
  Eigen::Map<Eigen::Matrix3d>(out.data()) = X.R;
  Eigen::Map<Eigen::Vector3d>(out.data() + 9) = X.p;
}

lie::Pose pose(const std::array<double, 12>& in) {
  lie::Pose X;
  X.R = Eigen::Map<const Eigen::Matrix3d>(in.data());
  X.p = Eigen::Map<const Eigen::Vector3d>(in.data() + 9);
  return X;
}

void put(runtime::Packer& p, const Eigen::VectorXd& v) {
  p.put(v.data(), static_cast<std::size_t>(v.size()));
}

void put(runtime::Packer& p, const scene::Goal& goal) {
  SavedGoal g{.id = goal.id, .kind = static_cast<std::uint64_t>(goal.kind)};
  put(g.pose, goal.X_WG);
  Eigen::Map<lie::Twist>(g.twist.data()) = goal.V_WG;
  p.put(g);
  put(p, goal.joints);
}

bool get(runtime::Unpacker& u, scene::Goal& goal) {
  SavedGoal g;
  if (!u.get(g) || !u.get_doubles(goal.joints)) return false;
  goal.id = g.id;
  goal.kind = static_cast<scene::GoalKind>(g.kind);
  goal.X_WG = pose(g.pose);
  goal.V_WG = Eigen::Map<const lie::Twist>(g.twist.data());
  return true;
}

void put(runtime::Packer& p, const geometry::Obstacle& o) {
  SavedObstacle s{.id = o.id,
                  .kind = static_cast<std::uint32_t>(o.shape.kind),
                  .velocity_known = o.velocity_known,
                  .sigma_m = o.sigma_m,
                  .seen_s = o.seen_s};
  Eigen::Map<Eigen::Vector3d>(s.dims_m.data()) = o.shape.dims_m;
  put(s.pose, o.X_WO);
  Eigen::Map<lie::Twist>(s.twist.data()) = o.V_WO;
  p.put(s);
}

bool get(runtime::Unpacker& u, geometry::Obstacle& o) {
  SavedObstacle s;
  if (!u.get(s)) return false;
  o.id = s.id;
  o.shape.kind = static_cast<geometry::ShapeKind>(s.kind);
  o.shape.dims_m = Eigen::Map<const Eigen::Vector3d>(s.dims_m.data());
  o.X_WO = pose(s.pose);
  o.V_WO = Eigen::Map<const lie::Twist>(s.twist.data());
  o.velocity_known = s.velocity_known != 0;
  o.sigma_m = s.sigma_m;
  o.seen_s = s.seen_s;
  return true;
}

void put(runtime::Packer& p, const EscapeQuestion& q) {
  p.put(q.step);
  put(p, q.q);
  put(p, q.qd);
  p.put(q.obstacles.size());
  for (const geometry::Obstacle& o : q.obstacles) put(p, o);
  p.put(q.obstacle_age_s);
  put(p, q.goal);
  p.put(q.goal_age_s);
  p.put(q.tries);
  p.put(static_cast<std::uint64_t>(q.stuck));
}

bool get(runtime::Unpacker& u, EscapeQuestion& q) {
  std::size_t obstacles = 0;
  if (!u.get(q.step) || !u.get_doubles(q.q) || !u.get_doubles(q.qd) || !u.get(obstacles)) return false;
  if (obstacles > Obstacles::kMost) return false;
  q.obstacles.resize(obstacles);
  for (geometry::Obstacle& o : q.obstacles)
    if (!get(u, o)) return false;
  std::uint64_t stuck = 0;
  const bool whole =
      u.get(q.obstacle_age_s) && get(u, q.goal) && u.get(q.goal_age_s) && u.get(q.tries) && u.get(stuck);
  q.stuck = stuck != 0;
  return whole;
}

}  // namespace

std::optional<Problem> PlannerService::open_checkpoint() {
  if (config_.state_dir.empty()) return {};
  auto c =
      runtime::Checkpoint::resume(config_.state_dir, "planner", scene_.arm, kKind, kCapacity, config_.boot,
                                  [this](std::span<const std::byte> bytes, bool) { return load(bytes); });
  if (!c) return c.error();
  checkpoint_ = std::move(c).value();
  packed_.reserve(kCapacity);
  pack_question();  // the one that was loaded, if any
  return {};
}

/// Once, when it is asked: it is saved in every cycle until the answer is there.
void PlannerService::pack_question() {
  if (!checkpoint_) return;
  runtime::Packer p(packed_question_);
  put(p, question_);
}

void PlannerService::save() {
  if (!checkpoint_ || !incarnation_ || !memory_step_) return;
  runtime::Packer p(packed_);
  p.put(fingerprint_);
  p.put(epoch_);
  p.put(*incarnation_);
  p.put(*memory_step_);
  p.put(mode_.has_value() ? static_cast<std::int64_t>(*mode_) : -1);
  p.put(mode_id_);
  const scene::Goal none;
  put(p, goal_ ? *goal_ : none);
  p.put(planner_.memory());
  p.put(command_.step);
  p.put(static_cast<std::uint32_t>(command_.planner_state));
  p.put(command_.torque.data(), static_cast<std::size_t>(command_.torque.size()));
  p.put(command_.caused_by);
  const bool waiting = planner_.memory().waypoint.waiting != 0 && escape_.asked();
  p.put(static_cast<std::uint64_t>(waiting));
  if (waiting) packed_.insert(packed_.end(), packed_question_.begin(), packed_question_.end());
  checkpoint_->save(packed_);
}

/// After a reboot as after a kill: what is too old for the arm's step by then is ramped in.
std::string PlannerService::load(std::span<const std::byte> bytes) {
  runtime::Unpacker u(bytes);
  std::uint64_t print = 0, epoch = 0, incarnation = 0, step = 0, mode_id = 0;
  std::int64_t mode = -1;
  std::uint64_t waiting = 0;
  scene::Goal goal;
  wire::TorqueCommand last;
  std::uint32_t last_state = 0;
  auto memory = std::make_unique<Memory>();
  const bool whole = u.get(print) && u.get(epoch) && u.get(incarnation) && u.get(step) && u.get(mode) &&
                     u.get(mode_id) && get(u, goal) && u.get(*memory) && u.get(last.step) &&
                     u.get(last_state) && u.get_doubles(last.torque) && u.get(last.caused_by) &&
                     u.get(waiting) && (waiting == 0 || get(u, question_)) && u.at_end();
  if (!whole) return "of another size or version";
  if (last.torque.size() != q_.size())
    return fmt::format("of an arm of {} joints, not {}", last.torque.size(), q_.size());
  if (print != fingerprint_) return "of another scene";
  epoch_ = (std::uint64_t{config_.strength} << 32) + (epoch & 0xffffffff) + 1;
  incarnation_ = incarnation;
  view_.begin(incarnation);
  memory_step_ = step;
  command_ = last;
  command_.arm = scene_.arm;
  command_.epoch = epoch_;
  command_.state_incarnation = incarnation;
  command_.t_s = static_cast<double>(last.step) * scene_.dynamics.dt_s;
  command_.planner_state = static_cast<wire::PlannerState>(last_state);
  if (mode >= 0) mode_ = static_cast<wire::Mode>(mode);
  mode_id_ = mode_id;
  planner_.restore(*memory);
  if (goal.id > 0) {  // which the memory may not have begun with
    goal_ = goal;
    planner_.set_goal(goal);
  }
  if (waiting != 0) start_escape();
  spdlog::info("resumed at step {} with goal {}", step, goal_ ? goal_->id : 0);
  return {};
}

}  // namespace hamel::planner
