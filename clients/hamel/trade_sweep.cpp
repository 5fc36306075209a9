#include "clients/hamel/trade_sweep.h"

#include <algorithm>
#include <cmath>

#include "common/base/text.h"
#include "common/rbd/rbd.h"

namespace hamel::trade {

namespace {

using dynamics::Options;
using Eigen::VectorXd;
using scene::Root;
using scene::Start;
using scene::Tier;

constexpr int kHalvings = 8;          // of the reference's step
constexpr double kShortRun_s = 0.02;  // a run this short is timed again
constexpr int kRepeats = 3;

/// One run over the horizon; `at(k)` is told the state at instant k = 1..kSamples and `after` each report.
template <class At, class After>
bool run(dynamics::Integrator& integrator, dynamics::State& s, const Motion& m, const Watch& watch, At at,
         After after) {
  const VectorXd tau = VectorXd::Zero(m.chain.n());
  const double dt_s = integrator.options().dt_s;
  const auto per_instant = std::llround(m.horizon_s / kSamples / dt_s);
  for (int k = 1; k <= kSamples; ++k) {
    for (long long i = 0; i < per_instant; ++i) {
      if (i % 256 == 0 && watch.stop()) return false;
      const dynamics::StepReport report = integrator.step(s, tau);
      if (!report.usable()) return false;
      after(report, s);
    }
    at(k, s);
  }
  return true;
}

std::vector<VectorXd> trajectory(const Motion& m, const Options& options, const Watch& watch) {
  dynamics::Integrator integrator(m.chain, options);
  dynamics::State s = integrator.start(m.q0, m.qd0);
  std::vector<VectorXd> q;
  const auto at = [&](int k, const dynamics::State& now) {
    q.push_back(now.q);
    watch.say("reference: gauss-8, dt " + text(options.dt_s) + " s, " + std::to_string(100 * k / kSamples) +
              " %");
  };
  run(integrator, s, m, watch, at, [](const auto&, const auto&) {});
  return q;
}

/// How long two runs agree to kAgreed, and their largest difference in that time.
Reference agreement(const std::vector<VectorXd>& coarse, const std::vector<VectorXd>& fine, const Motion& m) {
  Reference r;
  double worst = 0;
  for (std::size_t k = 0; k < std::min(coarse.size(), fine.size()); ++k) {
    const double difference = (coarse[k] - fine[k]).lpNorm<Eigen::Infinity>();
    if (!(difference <= kAgreed * (1 + fine[k].lpNorm<Eigen::Infinity>()))) break;
    worst = std::max(worst, difference);
    r.valid_s = m.horizon_s * static_cast<double>(k + 1) / kSamples;
    r.uncertainty = worst;
  }
  r.q = fine;
  return r;
}

bool gravity_along(const model::Chain& chain) {
  const model::Joint& first = chain.joint(0);
  const Eigen::Vector3d axis_W = (chain.X_WB0() * first.X_PJ).R * first.axis, g = chain.gravity_W_mps2();
  const double across = first.kind == model::JointKind::prismatic ? axis_W.dot(g) : axis_W.cross(g).norm();
  return std::abs(across) > 1e-12 * g.norm();
}

/// Collects what a run tells of itself.
struct Account {
  double drift_J = 0, drift_max_J = 0, kinetic_max_J = 0, p_max = 0, p1_off = 0;
  long long evaluations = 0, iterations = 0, steps = 0;
  void add(const dynamics::StepReport& r, const dynamics::State& s, double p1, Measured& out) {
    drift_J += r.energy_error_J;
    drift_max_J = std::max(drift_max_J, std::abs(drift_J));
    kinetic_max_J = std::max(kinetic_max_J, 0.5 * s.p.dot(s.qd));
    p_max = std::max(p_max, s.p.lpNorm<Eigen::Infinity>());
    p1_off = std::max(p1_off, std::abs(s.p[0] - p1));
    evaluations += r.evaluations, iterations += r.iterations, ++steps;
    out.iterations_max = std::max(out.iterations_max, r.iterations);
    out.substepped += r.substeps > 1 ? 1 : 0;
  }
};

double over(double a, double b) { return b > 0 ? a / b : a; }

Measured once(const Motion& m, const Options& options, const Reference& reference, const Watch& watch) {
  Measured out;
  out.options = options;
  dynamics::Integrator integrator(m.chain, options);
  dynamics::State s = integrator.start(m.q0, m.qd0);
  const double p1 = s.p[0], valid = reference.valid_s * (1 + 1e-9);
  Account account;
  const double began = watch.now_s();
  out.finished = run(
      integrator, s, m, watch,
      [&](int k, const dynamics::State& now) {
        if (m.horizon_s * k / kSamples > valid) return;
        const double off = (now.q - reference.q[static_cast<std::size_t>(k - 1)]).lpNorm<Eigen::Infinity>();
        out.joint_error = std::isnan(out.joint_error) ? off : std::max(out.joint_error, off);
      },
      [&](const dynamics::StepReport& r, const dynamics::State& now) { account.add(r, now, p1, out); });
  const double simulated = static_cast<double>(account.steps) * options.dt_s;
  out.refused_s = out.finished ? 0 : simulated;
  const double potential = rbd::energy_scale(m.chain);
  out.energy_error = over(account.drift_max_J, potential > 0 ? potential : account.kinetic_max_J);
  out.momentum_error = first_momentum_stays(m.chain, options) ? over(account.p1_off, account.p_max) : NAN;
  out.seconds_per_s = over(watch.now_s() - began, simulated);
  out.evaluations_per_s = over(static_cast<double>(account.evaluations), simulated);
  out.iterations_mean = over(static_cast<double>(account.iterations), static_cast<double>(account.steps));
  return out;
}

/// Steps base * 2^j for j in [from, to].
class List {
 public:
  List(const Motion& m, bool quick) : m_(m), stride_(quick ? 2 : 1) {}
  void add(Options o, int from, int to) {
    for (int j = from; j <= to; j += stride_) {
      o.dt_s = fitting_step(std::min(std::ldexp(m_.base.dt_s, j), m_.tick_s), m_.horizon_s);
      const bool again = !all_.empty() && all_.back().dt_s == o.dt_s && label(all_.back()) == label(o);
      if (!again) all_.push_back(o);
    }
  }
  std::vector<Options> take() { return std::move(all_); }

 private:
  const Motion& m_;
  int stride_;
  std::vector<Options> all_;
};

}  // namespace

bool first_momentum_stays(const model::Chain& chain, const Options& options) {
  return !gravity_along(chain) && chain.joint(0).damping == 0 && options.stop_stiffness == 0;
}

double fitting_step(double dt_s, double horizon_s) {
  const double between = horizon_s / kSamples;
  return between / std::max(1.0, std::round(between / dt_s));
}

std::string label(const Options& o) {
  std::string name = scene::to_string(o.tier);
  if (o.tier == Tier::gauss) name.append("-").append(std::to_string(o.stages));
  const bool implicit = o.tier == Tier::midpoint || o.tier == Tier::hamel;
  if (implicit) name.append(" ").append(scene::to_string(o.root));
  char text[32] = "";
  if (o.tier == Tier::dopri8)
    std::snprintf(text, sizeof text, " %.0e", o.tolerance_rel);
  else if (o.tolerance_Nm > 0)
    std::snprintf(text, sizeof text, " %.0e", o.tolerance_Nm);
  return name.append(text);
}

std::vector<Options> candidates(const Motion& m, bool quick) {
  List list(m, quick);
  Options o = m.base;
  o.tolerance_Nm = 0;
  o.start = Start::extrapolated;
  const auto with = [&](Tier tier, Root root, double tolerance_Nm) {
    Options c = o;
    c.tier = tier, c.root = root, c.tolerance_Nm = tolerance_Nm;
    return c;
  };
  list.add(with(Tier::semi_implicit_euler, Root::feedback, 0), -2, 2);
  list.add(with(Tier::hamel, Root::feedback, 1e-8), -2, 2);
  if (!quick) list.add(with(Tier::hamel, Root::newton, 1e-8), -2, 2);
  for (const Root root : {Root::adaptive, Root::feedback, Root::newton}) {
    list.add(with(Tier::midpoint, root, 0), -2, 4);
    if (!quick) list.add(with(Tier::midpoint, root, 1e-6), -2, 4);
  }
  for (const int stages : {2, 3, 4, 6, 8}) {
    if (quick && stages == 3) continue;
    o.stages = stages;
    list.add(with(Tier::gauss, Root::feedback, 0), stages / 2 - 1, stages / 2 + 4);
    if (!quick) list.add(with(Tier::gauss, Root::feedback, 1e-6), stages / 2 - 1, stages / 2 + 4);
  }
  list.add(with(Tier::rk4, Root::feedback, 0), -2, 5);
  for (int digits = 4; digits <= 13; digits += quick ? 3 : 1) {
    o.tolerance_rel = std::pow(10.0, -digits);
    o.dt_s = m.horizon_s / kSamples;
    auto adaptive = with(Tier::dopri8, Root::feedback, 0);
    list.add(adaptive, 100, 100);  // longer than any: one output an instant
  }
  return list.take();
}

Reference converge(const Motion& m, const Watch& watch) {
  Options o = m.base;
  o.tier = Tier::gauss, o.stages = 8, o.tolerance_Nm = 0, o.start = Start::extrapolated;
  o.dt_s = fitting_step(16 * m.base.dt_s, m.horizon_s);
  Reference best;
  std::vector<VectorXd> coarse = trajectory(m, o, watch);
  for (int k = 0; k < kHalvings && !watch.stop(); ++k) {
    o.dt_s /= 2;
    std::vector<VectorXd> fine = trajectory(m, o, watch);
    Reference now = agreement(coarse, fine, m);
    now.dt_s = o.dt_s;
    const bool better = now.valid_s > best.valid_s ||
                        (now.valid_s == best.valid_s && now.uncertainty < 0.3 * best.uncertainty);
    if (better) best = std::move(now);
    if (!better && best.valid_s > 0) break;  // rounding, or chaos, is all that is left
    if (best.valid_s >= m.horizon_s * (1 - 1e-9) && best.uncertainty < 1e-13) break;
    coarse = std::move(fine);
  }
  return best;
}

Measured measure(const Motion& m, const Options& options, const Reference& reference, const Watch& watch) {
  Measured out = once(m, options, reference, watch);
  for (int k = 1; k < kRepeats && out.finished && out.seconds_per_s * m.horizon_s < kShortRun_s; ++k) {
    const Measured again = once(m, options, reference, watch);
    if (again.finished) out.seconds_per_s = std::min(out.seconds_per_s, again.seconds_per_s);
  }
  return out;
}

}  // namespace hamel::trade
