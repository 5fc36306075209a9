#include "services/dynamics/core/integrator.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/dopri8.h"
#include "services/dynamics/core/gauss.h"
#include "services/dynamics/core/midpoint.h"
#include "services/dynamics/core/paper.h"
#include "services/dynamics/core/rounding.h"
#include "services/dynamics/core/rivals.h"

namespace hamel::dynamics {
namespace {

/// Energy that one undivided step may gain or lose beyond the work done, as a share of the energy in play.
constexpr double kEnergyBound = 0.1;

std::unique_ptr<TierStep> make_tier(const model::Chain& chain, const rbd::AxisChain& axis,
                                    const Options& options) {
  switch (options.tier) {
    case Tier::hamel:
      return std::make_unique<PaperStep>(axis, options);
    case Tier::gauss:
      return std::make_unique<GaussStep>(axis, options);
    case Tier::rk4:
      return std::make_unique<Rk4Step>(chain, axis, options);
    case Tier::dopri8:
      return std::make_unique<Dopri8Step>(chain, axis, options);
    case Tier::semi_implicit_euler:
      return std::make_unique<SemiImplicitEulerStep>(chain, axis, options);
    case Tier::midpoint:
      break;
  }
  return std::make_unique<MidpointStep>(axis, options);
}

}  // namespace

struct Integrator::Impl {
  Impl(const model::Chain& c, const Options& o)
      : chain(c),
        options(o),
        axis(chain),
        tier(make_tier(chain, axis, options)),
        now(axis),
        next(axis),
        ws(chain) {
    now.history.assign(tier->history_size(), 0);
    next.history = now.history;
  }

  bool acceptable(const State& s, const VectorXd& tau) const noexcept;
  void load(const State& s) noexcept;
  void store(State& s) const noexcept;
  bool sane(const StepReport& report, const VectorXd& tau, double h) const noexcept;
  StepReport advance(const VectorXd& tau, double h) noexcept;
  StepReport march(const VectorXd& tau) noexcept;

  const model::Chain chain;
  const Options options;
  const rbd::AxisChain axis;
  std::unique_ptr<TierStep> tier;
  Node now, next;
  bool loaded = false;
  rbd::Workspace ws;
};

/// Sizes fit and every number is finite: what comes from outside is not trusted.
bool Integrator::Impl::acceptable(const State& s, const VectorXd& tau) const noexcept {
  const auto n = axis.n();
  return s.q.size() == n && s.p.size() == n && s.qd.size() == n && tau.size() == n &&
         s.history.size() == now.history.size() && s.q.allFinite() && s.p.allFinite() && s.qd.allFinite() &&
         tau.allFinite() &&
         std::all_of(s.history.begin(), s.history.end(), [](double x) { return std::isfinite(x); });
}

/// Makes `now` the node of `s`.  A node computed by the last step is kept: place() and move_...() are
/// functions of what State holds, so a state that was saved and loaded gives the same bits.
void Integrator::Impl::load(const State& s) noexcept {
  now.history = s.history;
  if (loaded && now.q == s.q && now.p == s.p && now.qd == s.qd) return;
  now.place(axis, s.q);
  if (tier->integrates_velocity()) {
    now.move_with_velocity(axis, s.qd);
  } else {
    now.move_with_momentum(axis, s.p);
  }
  loaded = true;
}

void Integrator::Impl::store(State& s) const noexcept {
  s.q = now.q, s.p = now.p, s.qd = now.qd;
  s.history = now.history;
  ++s.step;
}

/// Guards against divergence and against spurious roots, of which the implicit equations have many at large
/// h.
bool Integrator::Impl::sane(const StepReport& report, const VectorXd& tau, double h) const noexcept {
  if (!next.finite()) return false;
  double work = std::abs(report.work_J);
  for (int i = 0; i < axis.n(); ++i) {
    const double d = next.q[i] - now.q[i];
    if (!axis[i].prismatic && std::abs(d - h * now.qd[i]) > tier->turn_bound()) return false;
    work += std::abs(tau[i] * d);
  }
  const double in_play = now.energy_J - now.potential_J + work + axis.energy_scale + kNothing;
  return std::abs(next.energy_J - now.energy_J - report.work_J) <= kEnergyBound * in_play;
}

/// One undivided step from `now` to `next`.
StepReport Integrator::Impl::advance(const VectorXd& tau, double h) noexcept {
  StepReport report = tier->advance(now, tau, h, next);
  if (report.usable() && !sane(report, tau, h)) report.stop = Stop::diverged;
  return report;
}

/// The whole step; parts that fail are halved, up to max_subdivisions times.  Leaves `now` at the end, or
/// anywhere on the way when it fails.
StepReport Integrator::Impl::march(const VectorXd& tau) noexcept {
  StepReport total;
  total.substeps = 0;
  const std::uint64_t whole = std::uint64_t{1} << options.max_subdivisions;
  std::uint64_t part = whole, done = 0;  // in units of the smallest part
  while (done < whole) {
    const double h = options.dt_s * (static_cast<double>(part) / static_cast<double>(whole));
    const StepReport r = advance(tau, h);
    total.iterations += r.iterations;
    total.evaluations += r.evaluations;
    if (!r.usable()) {
      total.stop = r.stop;
      if (part == 1) {
        total.residual_Nm = r.residual_Nm;
        return total;
      }
      part /= 2;
      continue;
    }
    total.residual_Nm = std::max(total.residual_Nm, r.residual_Nm);
    total.work_J += r.work_J;
    total.energy_error_J += next.energy_J - now.energy_J - r.work_J;
    // stagnation in one part is told of the whole
    total.stop = total.substeps > 0 && total.stop == Stop::stagnated ? Stop::stagnated : r.stop;
    ++total.substeps;
    std::swap(now, next);
    done += part;
  }
  return total;
}

Integrator::Integrator(const model::Chain& chain, const Options& options)
    : impl_(std::make_unique<Impl>(chain, options)) {}
Integrator::~Integrator() = default;
Integrator::Integrator(Integrator&&) noexcept = default;

State Integrator::start(const Eigen::VectorXd& q0, const Eigen::VectorXd& qd0) const {
  assert(q0.size() == impl_->axis.n() && qd0.size() == impl_->axis.n());
  Node node(impl_->axis);
  node.place(impl_->axis, q0);
  node.move_with_velocity(impl_->axis, qd0);
  if (!impl_->tier->integrates_velocity()) {
    const VectorXd p = node.p;
    node.move_with_momentum(impl_->axis, p);
  }
  return {0, node.q, node.p, node.qd, std::vector<double>(impl_->tier->history_size(), 0)};
}

StepReport Integrator::step(State& state, const Eigen::VectorXd& tau) noexcept {
  if (!impl_->acceptable(state, tau)) return {};
  impl_->load(state);
  const StepReport report = impl_->march(tau);
  if (report.usable()) impl_->store(state);
  return report;
}

void Integrator::gravity_torque(const Eigen::VectorXd& q, Eigen::VectorXd& tau_g) noexcept {
  assert(tau_g.size() == q.size());
  rbd::positions(impl_->chain, q, impl_->ws);
  rbd::gravity_torque(impl_->chain, impl_->ws, tau_g);
}

double Integrator::energy(const State& state) noexcept {
  impl_->load(state);
  return impl_->now.energy_J;
}

const model::Chain& Integrator::chain() const noexcept { return impl_->chain; }
const Options& Integrator::options() const noexcept { return impl_->options; }

}  // namespace hamel::dynamics
