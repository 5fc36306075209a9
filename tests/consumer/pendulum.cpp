// A point mass on a massless rod, let go at 1 rad: ten periods, compared with the elliptic integral.
#include <hamel/core.h>

#include <cmath>
#include <cstdio>

int main() {
  using namespace hamel;
  constexpr double kLength_m = 0.5, kAmplitude_rad = 1.0, kG = 9.81;
  model::ChainSpec spec;
  model::Joint joint;
  joint.name = "pivot";
  joint.axis = Eigen::Vector3d::UnitY();
  model::Link link;
  link.name = "bob";
  link.inertia.mass_kg = 2;
  link.inertia.com_m = {0, 0, -kLength_m};
  link.inertia.about_com_kgm2 = 1e-9 * Eigen::Matrix3d::Identity();
  spec.joints = {joint};
  spec.links = {link};
  const auto chain = model::build(spec);
  if (!chain) {
    for (const auto& p : chain.error()) std::puts(to_string(p).c_str());
    return 2;
  }

  dynamics::Options options;
  options.dt_s = 1e-4;
  dynamics::Integrator integrator(chain.value(), options);
  dynamics::State state =
      integrator.start(Eigen::VectorXd::Constant(1, kAmplitude_rad), Eigen::VectorXd::Zero(1));
  const Eigen::VectorXd no_torque = Eigen::VectorXd::Zero(1);

  // The period is 4 K(sin(a/2)) sqrt(l/g); count ten downward crossings of zero speed at the top.
  const double period_s = 4 * std::comp_ellint_1(std::sin(kAmplitude_rad / 2)) * std::sqrt(kLength_m / kG);
  const auto steps = static_cast<long>(std::lround(10 * period_s / options.dt_s));
  for (long k = 0; k < steps; ++k)
    if (!integrator.step(state, no_torque).usable()) return 1;
  const double error = std::abs(state.q[0] - kAmplitude_rad);
  std::printf("after ten periods of %.6f s the angle is %.9f rad\n", period_s, state.q[0]);
  return error < 1e-5 ? 0 : 1;
}
