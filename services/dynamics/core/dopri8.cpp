#include "services/dynamics/core/dopri8.h"

#include <algorithm>
#include <cmath>

namespace hamel::dynamics {

// Nodes, weights, differences of weights and matrix as printed by Hairer, Norsett, Wanner; that they meet the
// order conditions is tests/property/dopri8_test.cpp.
const std::array<double, 12> Dop853::c = {0,
                                          0.0526001519587677318785587544488,
                                          0.0789002279381515978178381316732,
                                          0.118350341907227396726757197510,
                                          0.281649658092772603273242802490,
                                          1. / 3,
                                          1. / 4,
                                          4. / 13,
                                          127. / 195,
                                          3. / 5,
                                          6. / 7,
                                          1};
const std::array<double, 12> Dop853::b = {0.0542937341165687622380535766363,
                                          0,
                                          0,
                                          0,
                                          0,
                                          4.45031289275240888144113950566,
                                          1.89151789931450038304281599044,
                                          -5.8012039600105847814672114227,
                                          0.31116436695781989440891606237,
                                          -0.152160949662516078556178806805,
                                          0.201365400804030348374776537501,
                                          0.0447106157277725905176885569043};
const std::array<double, 12> Dop853::error5 = {0.01312004499419488073250102996,
                                               0,
                                               0,
                                               0,
                                               0,
                                               -1.225156446376204440720569753,
                                               -0.4957589496572501915214079952,
                                               1.664377182454986536961530415,
                                               -0.350328848749973681688648729,
                                               0.3341791187130174790297318841,
                                               0.08192320648511571246570742613,
                                               -0.02235530786388629525884427845};
/// Weights of an embedded rule of order 3, to be subtracted from b.
const std::array<double, 12> Dop853::error3 = {31. / 127, 0, 0,
                                               0,         0, 0,
                                               0,         0, 0.733846688281611857341361741547,
                                               0,         0, 0.0220588235294117647058823529412};
const std::array<std::array<double, 12>, 12> Dop853::a = {{
    {},
    {0.0526001519587677318785587544488},
    {0.0197250569845378994544595329183, 0.0591751709536136983633785987549},
    {0.0295875854768068491816892993775, 0, 0.0887627564304205475450678981324},
    {0.241365134159266685502369798665, 0, -0.884549479328286085344864962717,
     0.924834003261792003115737966543},
    {1. / 27, 0, 0, 0.170828608729473871279604482173, 0.125467687566822425016691814123},
    {19. / 512, 0, 0, 0.170252211019544039314978060272, 0.0602165389804559606850219397283, -9. / 512},
    {0.0370920001185047927108779319836, 0, 0, 0.170383925712239993810214054705,
     0.107262030446373284651809199168, -0.0153194377486244017527936158236,
     0.00827378916381402288758473766002},
    {0.624110958716075717114429577812, 0, 0, -3.36089262944694129406857109825,
     -0.868219346841726006818189891453, 27.5920996994467083049415600797, 20.1540675504778934086186788979,
     -43.4898841810699588477366255144},
    {0.477662536438264365890433908527, 0, 0, -2.48811461997166764192642586468,
     -0.590290826836842996371446475743, 21.2300514481811942347288949897, 15.2792336328824235832596922938,
     -33.2882109689848629194453265587, -0.0203312017085086261358222928593},
    {-0.93714243008598732571704021658, 0, 0, 5.18637242884406370830023853209, 1.09143734899672957818500254654,
     -8.14978701074692612513997267357, -18.5200656599969598641566180701, 22.7394870993505042818970056734,
     2.49360555267965238987089396762, -3.0467644718982195003823669022},
    {2.27331014751653820792359768449, 0, 0, -10.5344954667372501984066689879,
     -2.00087205822486249909675718444, -17.9589318631187989172765950534, 27.9488845294199600508499808837,
     -2.85899827713502369474065508674, -8.87285693353062954433549289258, 12.3605671757943030647266201528,
     0.643392746015763530355970484046},
}};

namespace {
constexpr double kSafety = 0.9, kShrink = 1. / 3, kGrow = 6;
}  // namespace

template <class G>
Dopri8Step<G>::Dopri8Step(const typename G::Chain& chain, const Options& options)
    : chain_(chain),
      tolerance_(options.tolerance_rel),
      field_(chain, options.stop_stiffness),
      q_(VectorXd::Zero(chain.n())),
      qd_(q_),
      q_new_(q_),
      qd_new_(q_) {
  rate_.fill(q_);
  acceleration_.fill(q_);
}

/// From (q_, qd_) with stage 0 filled, to (q_new_, qd_new_).  Returns the error against the tolerance: <= 1
/// is good.
template <class G>
double Dopri8Step<G>::try_step(double h, const Load<G>& load) noexcept {
  const Eigen::Index n = q_.size();
  const auto add = [&](const std::array<double, 12>& weights, int count, double* q, double* qd) {
    for (int j = 0; j < count; ++j) {
      const std::size_t s = static_cast<std::size_t>(j);
      if (weights[s] == 0) continue;
      const double w = h * weights[s], *rate = rate_[s].data(), *acceleration = acceleration_[s].data();
      for (Eigen::Index k = 0; k < n; ++k) q[k] += w * rate[k], qd[k] += w * acceleration[k];
    }
  };
  for (int i = 1; i < Dop853::kStages; ++i) {
    const std::size_t s = static_cast<std::size_t>(i);
    q_new_ = q_, rate_[s] = qd_;
    add(Dop853::a[s], i, q_new_.data(), rate_[s].data());
    power_[s] = field_(q_new_, rate_[s], load, acceleration_[s]);
  }
  q_new_ = q_, qd_new_ = qd_;
  add(Dop853::b, Dop853::kStages, q_new_.data(), qd_new_.data());
  double sum5 = 0, sum3 = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    double q5 = 0, q3 = 0, v5 = 0, v3 = 0;
    for (std::size_t s = 0; s < Dop853::kStages; ++s) {
      const double rate = rate_[s].data()[k], acceleration = acceleration_[s].data()[k];
      const double w5 = Dop853::error5[s], w3 = Dop853::b[s] - Dop853::error3[s];
      q5 += w5 * rate, v5 += w5 * acceleration;
      q3 += w3 * rate, v3 += w3 * acceleration;
    }
    const double q_scale = tolerance_ * std::max({1.0, std::abs(q_[k]), std::abs(q_new_[k])});
    const double v_scale = tolerance_ * std::max({1.0, std::abs(qd_[k]), std::abs(qd_new_[k])});
    sum5 += q5 * q5 / (q_scale * q_scale) + v5 * v5 / (v_scale * v_scale);
    sum3 += q3 * q3 / (q_scale * q_scale) + v3 * v3 / (v_scale * v_scale);
  }
  if (sum5 == 0) return 0;
  return h * sum5 / std::sqrt(2 * static_cast<double>(q_.size()) * (sum5 + 0.01 * sum3));
}

/// A first step that is too short rather than too long: the controller grows it.
template <class G>
double Dopri8Step<G>::first_step(double h) const noexcept {
  const double speed = 1 + qd_.lpNorm<Eigen::Infinity>(), push = acceleration_[0].lpNorm<Eigen::Infinity>();
  return std::min(h, 0.01 * speed / std::max(push, speed));
}

template <class G>
StepReport Dopri8Step<G>::advance(const Node<G>& from, const Load<G>& load, double h, Node<G>& to) noexcept {
  StepReport report;
  q_ = from.q, qd_ = from.qd;
  const auto evaluate_first = [&] {
    rate_[0] = qd_;
    power_[0] = field_(q_, qd_, load, acceleration_[0]);
    ++report.evaluations;
  };
  evaluate_first();
  double next = from.history[0] > 0 ? from.history[0] : first_step(h), done = 0;
  while (done < h) {
    // no crumb is left for a last step
    const double left = h - done, step = next > 0.99 * left ? left : std::min(next, 0.5 * left);
    const double error = try_step(step, load);
    report.evaluations += Dop853::kStages - 1;
    if (++report.iterations > kMaxSteps) {
      report.stop = Stop::budget_spent;
      return report;
    }
    if (step < 1e-13 * h) return report;
    const double factor = std::isfinite(error) ? kSafety * std::pow(std::max(error, 1e-30), -1. / 8) : 0;
    if (!(error <= 1)) {
      next = step * std::max(kShrink, factor);
      continue;
    }
    for (std::size_t s = 0; s < Dop853::kStages; ++s) report.work_J += step * Dop853::b[s] * power_[s];
    if (step >= 0.99 * next || factor < 1) next = step * std::min(kGrow, factor);
    done = step == left ? h : done + step;
    q_.swap(q_new_), qd_.swap(qd_new_);
    if (done < h) evaluate_first();
  }
  to.history[0] = next;
  to.place(chain_, q_);
  to.move_with_velocity(chain_, qd_);
  report.stop = Stop::explicit_step;
  return report;
}

template class Dopri8Step<SE3>;
template class Dopri8Step<SE2>;

}  // namespace hamel::dynamics
