#include "services/dynamics/core/integrator.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <type_traits>
#include <utility>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/dopri8.h"
#include "services/dynamics/core/gauss.h"
#include "services/dynamics/core/marcher.h"
#include "services/dynamics/core/midpoint.h"
#include "services/dynamics/core/paper.h"
#include "services/dynamics/core/rivals.h"

namespace hamel::dynamics {
namespace {

template <class G>
std::unique_ptr<TierStep<G>> make_tier(const typename G::Chain& chain, const Options& options) {
  switch (options.tier) {
    case Tier::hamel:
      return std::make_unique<PaperStep<G>>(chain, options);
    case Tier::gauss:
      return std::make_unique<GaussStep<G>>(chain, options);
    case Tier::rk4:
      return std::make_unique<Rk4Step<G>>(chain, options);
    case Tier::dopri8:
      return std::make_unique<Dopri8Step<G>>(chain, options);
    case Tier::semi_implicit_euler:
      return std::make_unique<SemiImplicitEulerStep<G>>(chain, options);
    case Tier::midpoint:
      break;
  }
  return std::make_unique<MidpointStep<G>>(chain, options);
}

/// A world wrench in the axes that the group's recursions use.
rbd::Half6<double> in_axes(const rbd::AxisChain&, const lie::Wrench& F_W) {
  return {lie::vec3(F_W.head<3>()), lie::vec3(F_W.tail<3>())};
}
rbd::Half3<double> in_axes(const rbd::PlanarChain& chain, const lie::Wrench& F_W) {
  const Eigen::Vector3d force = chain.R_WE.transpose() * F_W.tail<3>();
  return {chain.R_WE.col(2).dot(F_W.head<3>()), {force.x(), force.y()}};
}

/// Two bodies as one.
model::Inertia together(const model::Inertia& a, const model::Inertia& b) {
  const double mass = a.mass_kg + b.mass_kg;
  if (!(mass > 0)) return a;
  const Eigen::Vector3d com = (a.mass_kg * a.com_m + b.mass_kg * b.com_m) / mass, r = b.com_m - a.com_m;
  const Eigen::Matrix3d apart = r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
  return {mass, com, a.about_com_kgm2 + b.about_com_kgm2 + a.mass_kg * b.mass_kg / mass * apart};
}

}  // namespace

/// What the integrator asks of an arm, whatever the group.
class Integrator::Impl {
 public:
  Impl(const model::Chain& c, const Options& o) : bare(c), chain(c), options(o), ws(chain) {}
  virtual ~Impl() = default;
  virtual State start(const VectorXd& q0, const VectorXd& qd0) const = 0;
  virtual StepReport step(State& state, const VectorXd& tau) noexcept = 0;
  virtual double energy(const State& state) noexcept = 0;
  virtual void set_wrench(int link, const lie::Wrench& F_W) noexcept = 0;
  virtual void clear_wrenches() noexcept = 0;
  virtual void reweigh(State& state) noexcept = 0;
  virtual void between(const State& before, const State& after, double share, VectorXd& q,
                       VectorXd& qd) noexcept = 0;
  virtual Space space() const noexcept = 0;
  virtual const VectorXd& torque_applied() const noexcept = 0;

  const model::Chain bare;  ///< without payload
  model::Chain chain;
  const Options options;
  rbd::Workspace ws;
};

namespace {

template <class G>
class Arm final : public Integrator::Impl {
 public:
  Arm(const model::Chain& c, const Options& o)
      : Impl(c, o), axis_(c), load_(axis_.n()), marcher_(axis_, options, make_tier<G>(axis_, options)) {
    for (int i = 0; i < axis_.n(); ++i) {
      const model::JointLimits& l = chain.joint(i).limits;
      limits_.push_back(l);
      weak_ = weak_ || std::isfinite(l.effort);
      limited_ = limited_ || std::isfinite(l.lower) || std::isfinite(l.upper) || std::isfinite(l.velocity);
    }
  }

  State start(const VectorXd& q0, const VectorXd& qd0) const override { return marcher_.start(q0, qd0); }
  StepReport step(State& state, const VectorXd& tau) noexcept override {
    if (tau.size() != axis_.n() || !all_finite(tau)) return {};
    const int saturated = cut(tau.data());
    StepReport report = marcher_.step(state, load_);
    report.saturated = saturated;
    if (report.usable()) report.beyond_limits = outside(state);
    return report;
  }
  double energy(const State& state) noexcept override { return marcher_.energy(state); }
  void set_wrench(int link, const lie::Wrench& F_W) noexcept override {
    load_.wrench[static_cast<std::size_t>(link)] = in_axes(axis_, F_W);
    load_.pushed = true;
  }
  void clear_wrenches() noexcept override {
    for (auto& F : load_.wrench) F = {};
    load_.pushed = false;
  }
  void reweigh(State& state) noexcept override {
    axis_.assign(chain);
    marcher_.reweigh(state);
  }
  void between(const State& before, const State& after, double share, VectorXd& q,
               VectorXd& qd) noexcept override {
    marcher_.between(before, after, share, q, qd);
  }
  Space space() const noexcept override { return std::is_same_v<G, SE2> ? Space::automatic : Space::se3; }
  const VectorXd& torque_applied() const noexcept override { return load_.tau; }

 private:
  /// Takes tau as far as the joints give it; how many give less.
  int cut(const double* tau) noexcept {
    double* given = load_.tau.data();
    if (!weak_) {
      std::copy_n(tau, axis_.n(), given);
      return 0;
    }
    int count = 0;
    for (const model::JointLimits& limits : limits_) {
      *given = std::clamp(*tau, -limits.effort, limits.effort);
      count += *given++ != *tau++;
    }
    return count;
  }
  int outside(const State& s) const noexcept {
    if (!limited_) return 0;
    const double *q = s.q.data(), *qd = s.qd.data();
    int count = 0;
    for (const model::JointLimits& limits : limits_) {
      count += (*q < limits.lower) | (*q > limits.upper) | (std::abs(*qd) > limits.velocity);
      ++q, ++qd;
    }
    return count;
  }

  typename G::Chain axis_;
  std::vector<model::JointLimits> limits_;
  bool weak_ = false, limited_ = false;  ///< any joint: in its effort; in position or velocity
  Load<G> load_;
  Marcher<G> marcher_;
};

std::unique_ptr<Integrator::Impl> make_arm(const model::Chain& chain, const Options& options) {
  if (options.space == Space::automatic && rbd::is_planar(chain))
    return std::make_unique<Arm<SE2>>(chain, options);
  return std::make_unique<Arm<SE3>>(chain, options);
}

}  // namespace

Integrator::Integrator(const model::Chain& chain, const Options& options) : impl_(make_arm(chain, options)) {}
Integrator::~Integrator() = default;
Integrator::Integrator(Integrator&&) noexcept = default;

State Integrator::start(const VectorXd& q0, const VectorXd& qd0) const {
  assert(q0.size() == chain().n() && qd0.size() == chain().n());
  return impl_->start(q0, qd0);
}
StepReport Integrator::step(State& state, const VectorXd& tau) noexcept { return impl_->step(state, tau); }

const VectorXd& Integrator::torque_applied() const noexcept { return impl_->torque_applied(); }

bool Integrator::set_wrench(int link, const lie::Wrench& F_W) noexcept {
  assert(link >= 0 && link < chain().n());
  if (!F_W.allFinite()) return false;
  impl_->set_wrench(link, F_W);
  return true;
}
void Integrator::clear_wrenches() noexcept { impl_->clear_wrenches(); }

Problems Integrator::set_payload(const model::Inertia& body_E, State& state) {
  if (!(body_E.mass_kg >= 0) || !body_E.com_m.allFinite() || !body_E.about_com_kgm2.allFinite())
    return {{"payload", "needs a mass >= 0 and finite numbers"}};
  model::ChainSpec spec = impl_->bare.spec();
  const lie::Pose& X_NE = spec.X_NE;
  const model::Inertia body_N{body_E.mass_kg, X_NE * body_E.com_m,
                              X_NE.R * body_E.about_com_kgm2 * X_NE.R.transpose()};
  model::Inertia& last = spec.links.back().inertia;
  last = together(last, body_N);
  auto laden = model::build(std::move(spec));
  if (!laden) return laden.error();
  impl_->chain = laden.value();
  impl_->ws.axis.assign(impl_->chain);
  impl_->reweigh(state);
  return {};
}

void Integrator::between(const State& before, const State& after, double share, VectorXd& q,
                         VectorXd& qd) noexcept {
  assert(q.size() == chain().n() && qd.size() == chain().n() && share >= 0 && share <= 1);
  impl_->between(before, after, share, q, qd);
}

void Integrator::gravity_torque(const VectorXd& q, VectorXd& tau_g) noexcept {
  assert(tau_g.size() == q.size());
  rbd::positions(impl_->chain, q, impl_->ws);
  rbd::gravity_torque(impl_->chain, impl_->ws, tau_g);
}

double Integrator::energy(const State& state) noexcept { return impl_->energy(state); }
const model::Chain& Integrator::chain() const noexcept { return impl_->chain; }
const Options& Integrator::options() const noexcept { return impl_->options; }
Space Integrator::space() const noexcept { return impl_->space(); }

}  // namespace hamel::dynamics
