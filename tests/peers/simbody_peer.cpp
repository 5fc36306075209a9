// Simbody.
#include <Simbody.h>

#include "tests/peers/peer.h"

namespace hamel::peers {

namespace {

SimTK::Vec3 vec3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

SimTK::Transform transform(const lie::Pose& X) {
  SimTK::Mat33 R;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) R(i, j) = X.R(i, j);
  return {SimTK::Rotation(R, true), vec3(X.p)};
}

/// Frame on the joint whose `main` axis (z of a pin, x of a slider) lies along the joint's.
lie::Pose along(const Eigen::Vector3d& axis, const Eigen::Vector3d& main) {
  return {Eigen::Quaterniond::FromTwoVectors(main, axis).toRotationMatrix(), Eigen::Vector3d::Zero()};
}

SimTK::Body::Rigid rigid(const model::Inertia& body) {
  const Eigen::Vector3d& c = body.com_m;
  const Eigen::Matrix3d I =
      body.about_com_kgm2 +
      body.mass_kg * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  return SimTK::Body::Rigid(SimTK::MassProperties(
      body.mass_kg, vec3(c), SimTK::Inertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2))));
}

class Simbody final : public Peer {
 public:
  explicit Simbody(const model::Chain& chain)
      : matter_(system_), forces_(system_), torques_(forces_, matter_) {
    SimTK::Force::UniformGravity(forces_, matter_, vec3(chain.gravity_W_mps2()));
    SimTK::MobilizedBody last = matter_.Ground();
    for (int i = 0; i < chain.n(); ++i) last = add(last, chain, i);
    system_.realizeTopology();
    state_ = system_.getDefaultState();
    system_.realizeModel(state_);
    none_ = SimTK::Vector(chain.n(), 0.0);
    udot_ = residual_ = none_;
  }
  std::string name() const override { return "Simbody"; }
  bool has_armature() const override { return false; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    set(q, qd);
    torques_.setAllMobilityForces(state_, none_);
    system_.realize(state_, SimTK::Stage::Dynamics);
    for (int i = 0; i < q.size(); ++i) udot_[i] = qdd[i];
    matter_.calcResidualForceIgnoringConstraints(
        state_, none_, system_.getRigidBodyForces(state_, SimTK::Stage::Dynamics), udot_, residual_);
    tau.resize(q.size());
    for (int i = 0; i < q.size(); ++i) tau[i] = residual_[i];
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    set(q, qd);
    for (int i = 0; i < q.size(); ++i) udot_[i] = tau[i];
    torques_.setAllMobilityForces(state_, udot_);
    system_.realize(state_, SimTK::Stage::Acceleration);
    qdd.resize(q.size());
    for (int i = 0; i < q.size(); ++i) qdd[i] = state_.getUDot()[i];
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override {
    set(q, VectorXd::Zero(q.size()));
    system_.realize(state_, SimTK::Stage::Position);
    SimTK::Matrix m;
    matter_.calcM(state_, m);
    M.resize(q.size(), q.size());
    for (int i = 0; i < q.size(); ++i)
      for (int j = 0; j < q.size(); ++j) M(i, j) = m(i, j);
  }
  std::vector<std::string> steppers() const override { return {"Verlet"}; }
  void begin(const std::string&, const VectorXd& q, const VectorXd& qd, double dt_s) override {
    set(q, qd);
    torques_.setAllMobilityForces(state_, none_);
    state_.setTime(0);
    integrator_ = std::make_unique<SimTK::VerletIntegrator>(system_, dt_s);
    integrator_->setProjectEveryStep(false);
    integrator_->setReturnEveryInternalStep(true);
    integrator_->initialize(state_);
  }
  void step() override {
    while (integrator_->stepTo(SimTK::Infinity) != SimTK::Integrator::TimeHasAdvanced) {
    }
  }

 private:
  SimTK::MobilizedBody add(SimTK::MobilizedBody& parent, const model::Chain& chain, int i) {
    const Eigen::Vector3d main = prismatic(chain, i) ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    const lie::Pose X_BM = along(chain.joint(i).axis, main);
    const SimTK::Transform inboard = transform(joint_pose(chain, i) * X_BM), outboard = transform(X_BM);
    const SimTK::Body::Rigid body = rigid(chain.link(i).inertia);
    if (prismatic(chain, i)) return SimTK::MobilizedBody::Slider(parent, inboard, body, outboard);
    return SimTK::MobilizedBody::Pin(parent, inboard, body, outboard);
  }
  void set(const VectorXd& q, const VectorXd& qd) {
    SimTK::Vector& to_q = state_.updQ();
    SimTK::Vector& to_u = state_.updU();
    for (int i = 0; i < q.size(); ++i) to_q[i] = q[i], to_u[i] = qd[i];
  }
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  SimTK::Force::DiscreteForces torques_;
  SimTK::State state_;
  SimTK::Vector none_, udot_, residual_;
  std::unique_ptr<SimTK::VerletIntegrator> integrator_;
};

}  // namespace

std::unique_ptr<Peer> make_simbody(const model::Chain& chain) { return std::make_unique<Simbody>(chain); }

}  // namespace hamel::peers
