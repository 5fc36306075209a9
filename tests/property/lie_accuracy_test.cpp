// Every function of the groups against fifty digits, at every angle: errors of at most 8 eps times the
// condition number, which is
//   exp, dexp        max(1, angle): a rounding of the angle turns so much
//   log, inverse of dexp   pole_condition(angle^2), at most pi/2 for a logarithm; its square where the
//   inverse of dexp
//                    stands on both sides, in the lower left block of SE(3)'s and SE(2)'s
// and errors of a block are held against the block's size or that of what it is computed from (a translation
// p = J rho may vanish where rho does not).
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/eigen.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/lie/se2.h"
#include "common/lie/se3.h"
#include "tests/support/chains.h"

namespace hamel::lie {
namespace {

namespace mp = boost::multiprecision;
using Real = mp::number<mp::cpp_bin_float<50>, mp::et_off>;
template <int N>
using Exact = Eigen::Matrix<Real, N, N>;
template <int N>
using Double = Eigen::Matrix<double, N, N>;

constexpr double kPi = std::numbers::pi, kEps = std::numeric_limits<double>::epsilon();
const double kAngles[] = {0,
                          1e-300,
                          1e-160,
                          1e-20,
                          1e-12,
                          1e-8,
                          1e-4,
                          0.1,
                          0.7071,
                          0.7072,
                          1,
                          1.9999,
                          2,
                          2.9999,
                          3,
                          3.1,
                          kPi - 1e-3,
                          kPi - 1e-8,
                          kPi - 1e-12,
                          kPi,
                          kPi + 1e-9,
                          3.5,
                          4,
                          5,
                          6,
                          2 * kPi - 1e-3,
                          2 * kPi - 1e-8,
                          2 * kPi + 1e-3,
                          7,
                          20,
                          1e3,
                          1e6};

/// exp(A): Taylor's series of A / 2^k, squared k times.
template <int N>
Exact<N> expm(Exact<N> A) {
  int squarings = 0;
  for (Real size = A.cwiseAbs().maxCoeff(); size > 0.25; size /= 2) ++squarings;
  A *= mp::ldexp(Real(1), -squarings);
  Exact<N> sum = Exact<N>::Identity(), term = sum;
  for (int k = 1; k < 40; ++k) {
    term = (term * A / Real(k)).eval();
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = (sum * sum).eval();
  return sum;
}
/// sum A^k / (k+1)!: the upper right block of exp [[A, 1], [0, 0]].
template <int N>
Exact<N> dexp_exact(const Double<N>& ad) {
  Exact<2 * N> wide = Exact<2 * N>::Zero();
  wide.template topLeftCorner<N, N>() = ad.template cast<Real>();
  wide.template topRightCorner<N, N>().setIdentity();
  return expm<2 * N>(wide).template topRightCorner<N, N>();
}
template <class A, class B>
double off(const A& got, const B& want) {
  return static_cast<double>((got.template cast<Real>() - want).cwiseAbs().maxCoeff());
}
template <class A>
double largest(const A& m) {
  return static_cast<double>(Real(m.cwiseAbs().maxCoeff()));
}

class LieAccuracy : public test::ForSeed {
 protected:
  /// Errors in units of eps times condition times size must stay below 8.
  void judge(const char* what, double error, double condition, double against) {
    if (error == 0) return;
    EXPECT_LE(error, 8 * kEps * condition * against)
        << what << ": " << error / (kEps * condition * against) << " eps at angle " << angle_;
  }
  template <class F>
  void at_all_angles(F f) {
    for (const double angle : kAngles) {
      angle_ = angle;
      f(angle);
    }
  }
  Twist twist(double angle) {
    Twist x;
    x << angle * rng.unit(), std::pow(10, rng.uniform(-3, 3)) * rng.unit();
    return x;
  }
  double angle_ = 0;
};
INSTANTIATE_TEST_SUITE_P(Property, LieAccuracy, testing::Range(0u, 6u));

double turned(double angle) { return std::max(1.0, angle); }

TEST_P(LieAccuracy, Rotations) {
  at_all_angles([&](double angle) {
    const Eigen::Vector3d phi = angle * rng.unit();
    const Exact<3> W = hat(phi).cast<Real>(), R = expm<3>(W), J = dexp_exact<3>(hat(phi));
    judge("exp", off(exp_so3(phi), R), turned(angle), 1);
    judge("dexp", off(dexp_so3(phi), J), turned(angle), 1);
    const double condition = pole_condition(phi.squaredNorm());
    if (std::isfinite(condition)) {
      const Exact<3> inverse = J.inverse();
      judge("inverse of dexp", off(dexp_inv_so3(phi), inverse), condition, largest(inverse));
    }
    if (angle > kPi) return;
    const Eigen::Vector3d back = log_so3(R.cast<double>());
    const double error = (back - phi).lpNorm<Eigen::Infinity>(),
                 turn = (back + phi).lpNorm<Eigen::Infinity>();
    judge("log", angle > kPi - 1e-11 ? std::min(error, turn) : error, condition, angle);
  });
}

TEST_P(LieAccuracy, RigidMotions) {
  at_all_angles([&](double angle) {
    const Twist x = twist(angle);
    const double rho = x.tail<3>().norm(), condition = pole_condition(x.head<3>().squaredNorm());
    const Exact<6> J = dexp_exact<6>(ad(x));
    const Exact<3> turn = expm<3>(hat(x.head<3>()).cast<Real>());
    const Eigen::Matrix<Real, 3, 1> p = J.topLeftCorner<3, 3>() * x.tail<3>().cast<Real>();
    const Pose X = exp_se3(x);
    judge("exp, rotation", off(X.R, turn), turned(angle), 1);
    judge("exp, translation", off(X.p, p), turned(angle), rho);
    const Matrix6 d = dexp_se3(x);
    judge("dexp, diagonal", off(d.topLeftCorner<3, 3>(), J.topLeftCorner<3, 3>()), turned(angle), 1);
    judge("dexp, coupling", off(d.bottomLeftCorner<3, 3>(), J.bottomLeftCorner<3, 3>()), turned(angle), rho);
    if (std::isfinite(condition)) {
      const Exact<6> K = J.inverse();
      const Matrix6 k = dexp_inv_se3(x);
      judge("inverse of dexp, diagonal", off(k.bottomRightCorner<3, 3>(), K.topLeftCorner<3, 3>()), condition,
            largest(K.topLeftCorner<3, 3>()));
      judge("inverse of dexp, coupling", off(k.bottomLeftCorner<3, 3>(), K.bottomLeftCorner<3, 3>()),
            condition * condition, std::max(rho, largest(K.bottomLeftCorner<3, 3>()) / condition));
    }
    if (angle > kPi - 1e-11) return;
    const Twist back = log_se3({turn.cast<double>(), p.cast<double>()});
    judge("log, rotation", (back - x).head<3>().lpNorm<Eigen::Infinity>(), condition, angle);
    judge("log, translation", (back - x).tail<3>().lpNorm<Eigen::Infinity>(), condition, rho);
  });
}

TEST_P(LieAccuracy, PlanarMotions) {
  at_all_angles([&](double size_of_angle) {
    const double angle = rng.coin(0.5) ? size_of_angle : -size_of_angle;
    const Eigen::Vector2d direction = rng.unit().head<2>();
    const double rho = std::pow(10, rng.uniform(-3, 3));
    const PlanarTwist x(angle, rho * direction.x(), rho * direction.y());
    const Exact<3> J = dexp_exact<3>(planar_ad(x));
    const Real t(angle), c = mp::cos(t), s = mp::sin(t);
    Exact<2> turn;
    turn << c, -s, s, c;
    // exp's translation is the lower right block of dexp applied to rho
    const Eigen::Matrix<Real, 2, 1> p = J.bottomRightCorner<2, 2>() * x.tail<2>().cast<Real>();
    const PlanarPose X = exp_se2(x);
    judge("exp, rotation", off(X.R, turn), turned(size_of_angle), 1);
    judge("exp, translation", off(X.p, p), turned(size_of_angle), rho);
    const Eigen::Matrix3d d = dexp_se2(x);
    judge("dexp, turn", off(d.bottomRightCorner<2, 2>(), J.bottomRightCorner<2, 2>()), turned(size_of_angle),
          1);
    judge("dexp, coupling", off(d.bottomLeftCorner<2, 1>(), J.bottomLeftCorner<2, 1>()),
          turned(size_of_angle), rho);
    const double condition = pole_condition(angle * angle);
    if (std::isfinite(condition)) {
      const Exact<3> K = J.inverse();
      const Eigen::Matrix3d k = dexp_inv_se2(x);
      judge("inverse of dexp, turn", off(k.bottomRightCorner<2, 2>(), K.bottomRightCorner<2, 2>()), condition,
            largest(K.bottomRightCorner<2, 2>()));
      judge("inverse of dexp, coupling", off(k.bottomLeftCorner<2, 1>(), K.bottomLeftCorner<2, 1>()),
            condition, std::max(rho, largest(K.bottomLeftCorner<2, 1>())));
    }
    if (size_of_angle > kPi - 1e-11) return;
    const PlanarTwist back = log_se2({turn.cast<double>(), p.cast<double>()});
    judge("log, angle", std::abs(back[0] - angle), condition, size_of_angle);
    judge("log, translation", (back - x).tail<2>().lpNorm<Eigen::Infinity>(), condition, rho);
  });
}

TEST_P(LieAccuracy, Adjoints) {
  for (const double reach : {0.0, 1e-6, 1.0, 1e6}) {
    angle_ = rng.uniform(0, 3);
    const Pose X{exp_so3(angle_ * rng.unit()), reach * rng.unit()};
    const Eigen::Matrix<Real, 3, 3> R = X.R.cast<Real>(), P = hat(X.p).cast<Real>(), PR = P * R;
    const Twist x = twist(angle_), y = twist(1);
    const Eigen::Matrix<Real, 3, 1> w = R * x.head<3>().cast<Real>(),
                                    v = R * x.tail<3>().cast<Real>() + P * w;
    judge("Ad, matrix", off(Ad(X).bottomLeftCorner<3, 3>(), PR), 1, reach);
    judge("Ad, angular", off(Ad(X, x).head<3>(), w), 1, x.head<3>().norm());
    judge("Ad, linear", off(Ad(X, x).tail<3>(), v), 1, x.tail<3>().norm() + reach * x.head<3>().norm());
    judge("Ad inverse",
          off(Ad_inv(X, y).tail<3>(),
              Eigen::Matrix<Real, 3, 1>(R.transpose() *
                                        (y.tail<3>().cast<Real>() - P * y.head<3>().cast<Real>()))),
          1, y.tail<3>().norm() + reach * y.head<3>().norm());
    const Eigen::Matrix<Real, 6, 1> bracket = ad(x).cast<Real>() * y.cast<Real>();
    judge("ad, angular", off(ad(x, y).head<3>(), bracket.head<3>()), 1,
          x.head<3>().norm() * y.head<3>().norm());
    judge("ad, linear", off(ad(x, y).tail<3>(), bracket.tail<3>()), 1,
          x.head<3>().norm() * y.tail<3>().norm() + x.tail<3>().norm() * y.head<3>().norm());
  }
}

// At a pole of the inverse of dexp there is no number to give: what the pole touches is not finite, and
// pole_condition() says so beforehand.
TEST(LiePoles, AreReported) {
  for (const double k : {1.0, 2.0, 3.0, 7.0}) {
    const double angle = 2 * kPi * k;
    const Eigen::Vector3d phi(0, 0, angle);
    EXPECT_TRUE(std::isinf(pole_condition(phi.squaredNorm()))) << k;
    EXPECT_FALSE(dexp_inv_so3(phi).allFinite()) << k;
    Twist x;
    x << phi, 1, 2, 3;
    EXPECT_FALSE(dexp_inv_se3(x).allFinite()) << k;
    EXPECT_FALSE(dexp_inv_se2({angle, 1, 2}).allFinite()) << k;
    EXPECT_TRUE(exp_se3(x).p.allFinite() && dexp_se3(x).allFinite());
  }
  EXPECT_TRUE(dexp_inv_so3({0, 0, kPi}).allFinite());
  EXPECT_LT(pole_condition(kPi * kPi), 1.6);
}

}  // namespace
}  // namespace hamel::lie
