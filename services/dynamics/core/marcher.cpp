#include "services/dynamics/core/marcher.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "services/dynamics/core/rounding.h"

namespace hamel::dynamics {
namespace {

/// Energy that one undivided step may gain or lose beyond the work done, as a share of the energy in play.
constexpr double kEnergyBound = 0.1;
/// The same over all steps: up to kDrift nobody asks; then a part may add kTrickle at most, and up to
/// kDriftLimit.
constexpr double kDrift = 0.25, kDriftLimit = 0.5, kTrickle = 1e-3;

/// Bits that differ.  Number by number: wider loads would wait for stores of the last step that are still
/// under way.
std::uint64_t differ(double a, double b) noexcept {
  return std::bit_cast<std::uint64_t>(a) ^ std::bit_cast<std::uint64_t>(b);
}

}  // namespace

template <class G>
Marcher<G>::Marcher(const Chain& chain, const Options& options, std::unique_ptr<TierStep<G>> tier)
    : chain_(chain),
      options_(options),
      tier_(std::move(tier)),
      nodes_{Node<G>(chain), Node<G>(chain)},
      q_(now_->q),
      p_(now_->q) {
  for (Node<G>& node : nodes_) node.history.assign(tier_->history_size(), 0);
}

template <class G>
State Marcher<G>::start(const VectorXd& q0, const VectorXd& qd0) const {
  Node<G> node(chain_);
  node.place(chain_, q0);
  node.move_with_velocity(chain_, qd0);
  if (!tier_->integrates_velocity()) {
    node.move_with_momentum(chain_);
  }
  return {0, node.q, node.p, node.qd, std::vector<double>(now_->history.size() + Ledger::kSize, 0)};
}

template <class G>
bool Marcher<G>::fits(const State& s) const noexcept {
  const auto n = chain_.n();
  return s.q.size() == n && s.p.size() == n && s.qd.size() == n &&
         s.history.size() == now_->history.size() + Ledger::kSize;
}

template <class G>
bool Marcher<G>::acceptable(const State& s) const noexcept {
  return fits(s) && all_finite(s.q) && all_finite(s.p) && all_finite(s.qd) && all_finite(s.history);
}

/// True when `s` is what `now` was stored to.
template <class G>
bool Marcher<G>::holds(const State& s) const noexcept {
  if (!loaded_) return false;
  const std::size_t own = now_->history.size();
  const double *q = now_->q.data(), *p = now_->p.data(), *qd = now_->qd.data(), *s_q = s.q.data(),
               *s_p = s.p.data(), *s_qd = s.qd.data(), *ledger = s.history.data() + own;
  std::uint64_t bits = differ(ledger[0], ledger_.made_up) | differ(ledger[1], ledger_.exchanged);
  for (int i = 0; i < chain_.n(); ++i)
    bits |= differ(q[i], s_q[i]) | differ(p[i], s_p[i]) | differ(qd[i], s_qd[i]);
  return bits == 0 &&
         (own == 0 || std::memcmp(s.history.data(), now_->history.data(), own * sizeof(double)) == 0);
}

/// Makes `now` the node of `s`.  False when its sizes do not fit or a number is not finite: what comes from
/// outside is not trusted.  A node computed by the last step is kept: place() and move_...() are functions of
/// what State holds, so a state that was saved and loaded gives the same bits.
template <class G>
bool Marcher<G>::load(const State& s) noexcept {
  if (!fits(s)) return false;
  if (holds(s)) return true;
  if (!acceptable(s)) return false;
  const std::size_t own = now_->history.size();
  std::copy_n(s.history.begin(), own, now_->history.begin());
  ledger_ = {s.history[own], s.history[own + 1]};
  now_->place(chain_, s.q);
  if (tier_->integrates_velocity()) {
    now_->move_with_velocity(chain_, s.qd);
  } else {
    now_->p = s.p;
    now_->move_with_momentum(chain_);
  }
  return loaded_ = true;
}

template <class G>
void Marcher<G>::store(State& s) const noexcept {
  s.q = now_->q, s.p = now_->p, s.qd = now_->qd;
  std::copy(now_->history.begin(), now_->history.end(), s.history.begin());
  s.history[now_->history.size()] = ledger_.made_up;
  s.history[now_->history.size() + 1] = ledger_.exchanged;
  ++s.step;
}

/// Guards against divergence, against spurious roots, of which the implicit equations have many at large h,
/// and against drift.
template <class G>
bool Marcher<G>::sane(const StepReport& report, const Load<G>& load, double h) const noexcept {
  const double bound = tier_->turn_bound(), *q = now_->q.data(), *qd = now_->qd.data(),
               *q_next = next_->q.data(), *tau = load.tau.data();
  double work = std::abs(report.work_J);
  for (int i = 0; i < chain_.n(); ++i) {
    const double d = q_next[i] - q[i];
    if (!chain_[i].prismatic && std::abs(d - h * qd[i]) > bound) return false;
    work += std::abs(tau[i] * d);
  }
  // Nothing infinite hides: q would be in the work, p and qd in p . qd.
  const double in_play = now_->kinetic_J + work + chain_.energy_scale + kNothing;
  const double made_up = next_->energy_J - now_->energy_J - report.work_J;
  if (!std::isfinite(in_play) || !std::isfinite(made_up)) return false;
  return std::abs(made_up) <= kEnergyBound * in_play && (!tier_->keeps_energy() || allowed(made_up, in_play));
}

/// What the ledger says to a part that makes up so much.
template <class G>
bool Marcher<G>::allowed(double made_up, double in_play) const noexcept {
  const double before = std::abs(ledger_.made_up), after = std::abs(ledger_.made_up + made_up);
  const double measure = in_play + ledger_.exchanged;
  return after <= kDrift * measure || after <= before ||
         (std::abs(made_up) <= kTrickle * in_play && after <= kDriftLimit * measure);
}

/// One undivided step from `now` to `next`.
template <class G>
StepReport Marcher<G>::advance(const Load<G>& load, double h) noexcept {
  StepReport report = tier_->advance(*now_, load, h, *next_);
  if (report.usable() && !sane(report, load, h)) report.stop = Stop::diverged;
  return report;
}

/// The whole step; parts that fail are halved, up to max_subdivisions times.  Leaves `now` at the end, or
/// anywhere on the way when it fails.
template <class G>
StepReport Marcher<G>::march(const Load<G>& load) noexcept {
  StepReport total;
  total.substeps = 0;
  const std::uint64_t whole = std::uint64_t{1} << options_.max_subdivisions;
  std::uint64_t part = whole, done = 0;  // in units of the smallest part
  while (done < whole) {
    const double h = options_.dt_s * (static_cast<double>(part) / static_cast<double>(whole));
    const StepReport r = advance(load, h);
    total.iterations += r.iterations;
    total.evaluations += r.evaluations;
    const bool exhausted = total.iterations > tier_->budget();
    if (!r.usable()) {
      total.stop = r.stop;
      if (part == 1 || exhausted) {
        total.residual_Nm = r.residual_Nm;
        return total;
      }
      part /= 2;
      continue;
    }
    const double made_up = next_->energy_J - now_->energy_J - r.work_J;
    total.residual_Nm = std::max(total.residual_Nm, r.residual_Nm);
    total.work_J += r.work_J;
    total.energy_error_J += made_up;
    ledger_.made_up += made_up;
    ledger_.exchanged += std::abs(r.work_J);
    total.made_up_J = ledger_.made_up;
    // stagnation in one part is told of the whole
    total.stop = total.substeps > 0 && total.stop == Stop::stagnated ? Stop::stagnated : r.stop;
    ++total.substeps;
    std::swap(now_, next_);
    done += part;
    if (exhausted && done < whole) {
      total.stop = Stop::budget_spent;
      break;
    }
  }
  return total;
}

template <class G>
StepReport Marcher<G>::step(State& s, const Load<G>& acting) noexcept {
  if (!load(s)) return {};
  const StepReport report = march(acting);
  if (report.usable()) store(s);
  return report;
}

template <class G>
double Marcher<G>::energy(const State& s) noexcept {
  return load(s) ? now_->energy_J : std::numeric_limits<double>::quiet_NaN();
}

template <class G>
void Marcher<G>::reweigh(State& s) noexcept {
  loaded_ = false;
  if (!acceptable(s)) return;
  next_->place(chain_, s.q);
  next_->move_with_velocity(chain_, s.qd);
  s.p = next_->p;
}

template <class G>
void Marcher<G>::between(const State& before, const State& after, double share, VectorXd& q,
                         VectorXd& qd) noexcept {
  if (!acceptable(before) || !acceptable(after)) return;
  const double h = options_.dt_s;
  next_->q = after.q, next_->p = after.p;
  std::copy_n(after.history.begin(), next_->history.size(), next_->history.begin());
  if (tier_->interpolate(*next_, (1 - share) * h, q_, p_)) {
    next_->place(chain_, q_);
    next_->p = p_;
    next_->move_with_momentum(chain_);
    q = next_->q, qd = next_->qd;
    return;
  }
  const double t = share, u = 1 - share;
  for (int i = 0; i < chain_.n(); ++i) {
    const double d = after.q[i] - before.q[i], a = h * before.qd[i], b = h * after.qd[i];
    q[i] = before.q[i] + t * t * (3 - 2 * t) * d + t * u * (u * a - t * b);
    qd[i] = (6 * t * u * d + u * (1 - 3 * t) * a + t * (3 * t - 2) * b) / h;
  }
}

template class Marcher<SE3>;
template class Marcher<SE2>;

}  // namespace hamel::dynamics
