/// What a restart of the dynamics service resumes from, and how.

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "services/dynamics/service.h"

namespace hamel::dynamics {

namespace {

constexpr std::uint32_t kKind = 0x0105;  // dynamics, layout 5
constexpr std::uint64_t kNone = ~std::uint64_t{0};
constexpr std::int64_t kNotDriven = std::numeric_limits<std::int64_t>::min();

std::size_t length(const Eigen::VectorXd& v) { return static_cast<std::size_t>(v.size()); }

/// The whole of a checkpoint, as plain values.
struct Saved {
  std::uint64_t fingerprint = 0, incarnation = 0;
  State s;
  Books books;
  TrajectoryHash::Digest digest{};
  std::int32_t mode = -1;
  std::uint64_t mode_id = 0;
  Eigen::VectorXd held, applied, command;
  std::uint64_t command_step = kNone, epoch = 0;
  std::int64_t driven_from = kNotDriven;
  bus::WriterId owner{};
  std::uint32_t planner_state = 0, validity = 0, gravity = 0;
  wire::Causes causes;

  bool read(std::span<const std::byte> bytes) {
    runtime::Unpacker u(bytes);
    return u.get(fingerprint) && u.get(incarnation) && u.get(s.step) && u.get_doubles(s.q) &&
           u.get_doubles(s.p) && u.get_doubles(s.qd) && u.get_doubles(s.history) && u.get(books) &&
           u.get(digest) && u.get(mode) && u.get(mode_id) && u.get_doubles(held) && u.get_doubles(applied) &&
           u.get_doubles(command) && u.get(command_step) && u.get(driven_from) && u.get(epoch) &&
           u.get(owner) && u.get(planner_state) && u.get(validity) && u.get(gravity) && u.get(causes) &&
           u.at_end();
  }
  bool fits(Eigen::Index n) const {
    return s.q.size() == n && s.p.size() == n && s.qd.size() == n && applied.size() == n &&
           command.size() == n && (held.size() == 0 || held.size() == n);
  }
};

}  // namespace

Result<std::unique_ptr<runtime::Checkpoint>, Problem> DynamicsService::open_checkpoint() {
  return runtime::Checkpoint::resume(
      config_.state_dir, "dynamics", scene_.arm, kKind, 4096 + length(arm_.state().q) * 512, config_.boot,
      [this](std::span<const std::byte> bytes, bool rebooted) { return load(bytes, rebooted); });
}

void DynamicsService::save() {
  if (!checkpoint_) return;
  runtime::Packer p(packed_);
  const State& s = arm_.state();
  p.put(fingerprint_);
  p.put(incarnation_);
  p.put(s.step);
  p.put(s.q.data(), length(s.q));
  p.put(s.p.data(), length(s.p));
  p.put(s.qd.data(), length(s.qd));
  p.put(s.history.data(), s.history.size());
  p.put(arm_.books());
  p.put(hash_.digest());
  p.put(mode_.has_value() ? static_cast<std::int32_t>(*mode_) : -1);
  p.put(mode_id_);
  const Eigen::VectorXd* held = arm_.held();
  p.put(held ? held->data() : nullptr, held ? length(*held) : 0);
  p.put(arm_.torque_applied().data(), length(arm_.torque_applied()));
  p.put(command_.data(), length(command_));
  p.put(command_step_.value_or(kNone));
  p.put(driven_from_.value_or(kNotDriven));
  p.put(epoch_);
  p.put(owner_);
  p.put(static_cast<std::uint32_t>(planner_state_));
  p.put(static_cast<std::uint32_t>(validity_));
  p.put(static_cast<std::uint32_t>(command_includes_gravity_));
  p.put(state_.caused_by);
  checkpoint_->save(packed_);
}

/// The command in force and whose it is come back too: the arm goes on with it as long as it is fresh.  After
/// a reboot the last steps are lost that others have seen: it is another arm to them, and in real time it
/// holds until it is driven anew.
std::string DynamicsService::load(std::span<const std::byte> bytes, bool rebooted) {
  Saved saved;
  const auto n = arm_.state().q.size();
  if (!saved.read(bytes)) return "of another size or version";
  if (!saved.fits(n)) return fmt::format("of an arm of {} joints, not {}", saved.s.q.size(), n);
  if (saved.fingerprint != fingerprint_) return "of another scene";
  incarnation_ = rebooted ? std::max(saved.incarnation + 1, incarnation_) : saved.incarnation;
  arm_.restore(saved.s, saved.books, saved.applied, saved.held.size() > 0 ? &saved.held : nullptr);
  hash_.restore(saved.digest);
  if (saved.mode >= 0) mode_ = static_cast<wire::Mode>(saved.mode);
  mode_id_ = saved.mode_id;
  command_ = saved.command;
  if (!rebooted || config_.pace == scene::Pace::lockstep) {
    if (saved.command_step != kNone) command_step_ = saved.command_step;
    if (saved.driven_from != kNotDriven) driven_from_ = saved.driven_from;
    epoch_ = saved.epoch;
    owner_ = saved.owner;
  }
  planner_state_ = static_cast<wire::PlannerState>(saved.planner_state);
  validity_ = static_cast<wire::Validity>(saved.validity);
  command_includes_gravity_ = saved.gravity != 0;
  state_.caused_by = saved.causes;
  spdlog::info("resumed at step {} (t = {:.3f} s){}", arm_.state().step, arm_.t_s(),
               rebooted ? fmt::format(", after a reboot: incarnation {}", incarnation_) : "");
  return {};
}

}  // namespace hamel::dynamics
