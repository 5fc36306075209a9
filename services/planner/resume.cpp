/// What a restart of the planner service resumes from, and how.

#include "services/planner/service.h"

namespace hamel::planner {

namespace {

constexpr std::uint32_t kKind = 0x0203;  // planner, layout 3

struct SavedGoal {
  std::uint64_t id = 0, kind = 0, joints = 0;
  std::array<double, 12> pose{};
  std::array<double, 6> twist{};
};

}  // namespace

std::optional<Problem> PlannerService::open_checkpoint() {
  if (config_.state_dir.empty()) return {};
  auto c = runtime::Checkpoint::resume(config_.state_dir, "planner", scene_.arm, kKind, sizeof(Memory) + 8192,
                                       [this](std::span<const std::byte> bytes) { return load(bytes); });
  if (!c) return c.error();
  checkpoint_ = std::move(c).value();
  return {};
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
  SavedGoal g;
  if (goal_) {
    g.id = goal_->id;
    g.kind = static_cast<std::uint64_t>(goal_->kind);
    Eigen::Map<Eigen::Matrix3d>(g.pose.data()) = goal_->X_WG.R;
    Eigen::Map<Eigen::Vector3d>(g.pose.data() + 9) = goal_->X_WG.p;
    Eigen::Map<lie::Twist>(g.twist.data()) = goal_->V_WG;
  }
  p.put(g);
  p.put(goal_ ? goal_->joints.data() : nullptr, goal_ ? static_cast<std::size_t>(goal_->joints.size()) : 0);
  p.put(planner_.memory());
  p.put(command_.step);
  p.put(static_cast<std::uint32_t>(command_.planner_state));
  p.put(command_.torque.data(), static_cast<std::size_t>(command_.torque.size()));
  p.put(command_.caused_by);
  checkpoint_->save(packed_);
}

bool PlannerService::load(std::span<const std::byte> bytes) {
  runtime::Unpacker u(bytes);
  std::uint64_t print = 0, epoch = 0, incarnation = 0, step = 0, mode_id = 0;
  std::int64_t mode = -1;
  SavedGoal g;
  Eigen::VectorXd joints;
  wire::TorqueCommand last;
  std::uint32_t last_state = 0;
  auto memory = std::make_unique<Memory>();
  const bool whole = u.get(print) && u.get(epoch) && u.get(incarnation) && u.get(step) && u.get(mode) &&
                     u.get(mode_id) && u.get(g) && u.get_doubles(joints) && u.get(*memory) &&
                     u.get(last.step) && u.get(last_state) && u.get_doubles(last.torque) &&
                     u.get(last.caused_by) && u.at_end();
  if (!whole || print != fingerprint_ || last.torque.size() != q_.size()) return false;
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
  if (g.id > 0) {
    scene::Goal goal;
    goal.id = g.id;
    goal.kind = static_cast<scene::GoalKind>(g.kind);
    goal.X_WG.R = Eigen::Map<Eigen::Matrix3d>(g.pose.data());
    goal.X_WG.p = Eigen::Map<Eigen::Vector3d>(g.pose.data() + 9);
    goal.V_WG = Eigen::Map<lie::Twist>(g.twist.data());
    goal.joints = joints;
    goal_ = goal;
    planner_.set_goal(goal);
  }
  planner_.restore(*memory);
  spdlog::info("resumed at step {} with goal {}", step, goal_ ? goal_->id : 0);
  return true;
}

}  // namespace hamel::planner
