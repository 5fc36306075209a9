// DART.
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/PrismaticJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/simulation/World.hpp>
#include <dart/utils/urdf/DartLoader.hpp>
#include <stdexcept>

#include "tests/peers/peer.h"

namespace hamel::peers {

namespace {

namespace dd = dart::dynamics;

Eigen::Isometry3d isometry(const lie::Pose& X) {
  Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
  out.linear() = X.R;
  out.translation() = X.p;
  return out;
}

template <class Joint>
dd::BodyNode* add(dd::SkeletonPtr arm, dd::BodyNode* parent, const model::Chain& chain, int i) {
  typename Joint::Properties joint;
  joint.mName = std::string("j").append(std::to_string(i));
  joint.mAxis = chain.joint(i).axis;
  joint.mT_ParentBodyToJoint = isometry(joint_pose(chain, i));
  const model::Inertia& body = chain.link(i).inertia;
  dd::BodyNode::Properties properties;
  properties.mName = std::string("l").append(std::to_string(i));
  properties.mInertia = dd::Inertia(body.mass_kg, body.com_m, body.about_com_kgm2);
  return arm->createJointAndBodyNodePair<Joint>(parent, joint, properties).second;
}

dd::SkeletonPtr translate(const model::Chain& chain) {
  const dd::SkeletonPtr arm = dd::Skeleton::create("arm");
  dd::BodyNode* last = nullptr;
  for (int i = 0; i < chain.n(); ++i)
    last = prismatic(chain, i) ? add<dd::PrismaticJoint>(arm, last, chain, i)
                               : add<dd::RevoluteJoint>(arm, last, chain, i);
  return arm;
}

/// A link without inertia weighs next to nothing: DART's own default is 1 kg.
dd::SkeletonPtr load(const std::string& urdf, const model::Chain& chain) {
  using Loader = dart::utils::DartLoader;
  const dd::Inertia nothing(1e-14, Eigen::Vector3d::Zero(), 1e-14 * Eigen::Matrix3d::Identity());
  Loader loader(Loader::Options(nullptr, Loader::RootJointType::FIXED, nothing));
  const dd::SkeletonPtr arm = loader.parseSkeletonString(urdf, dart::common::Uri());
  if (!arm || arm->getNumDofs() != static_cast<std::size_t>(chain.n()))
    throw std::runtime_error("DART reads another robot");
  for (int i = 0; i < chain.n(); ++i)
    if (arm->getDof(static_cast<std::size_t>(i))->getName() != chain.joint(i).name)
      throw std::runtime_error("DART reads other joints");
  return arm;
}

class Dart final : public Peer {
 public:
  Dart(dd::SkeletonPtr arm, const model::Chain& chain)
      : arm_(std::move(arm)), damping_(VectorXd::Zero(chain.n())) {
    for (Eigen::Index i = 0; i < chain.n(); ++i) {
      dd::DegreeOfFreedom* const joint = arm_->getDof(static_cast<std::size_t>(i));
      damping_[i] = joint->getDampingCoefficient();
      joint->setDampingCoefficient(0);
    }
    arm_->setGravity(chain.gravity_W_mps2());
  }
  VectorXd damping() const override { return damping_; }
  std::string name() const override { return "DART"; }
  bool has_armature() const override { return false; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    arm_->setPositions(q);
    arm_->setVelocities(qd);
    arm_->setAccelerations(qdd);
    arm_->computeInverseDynamics();
    tau = arm_->getForces();
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    arm_->setPositions(q);
    arm_->setVelocities(qd);
    arm_->setForces(tau);
    arm_->computeForwardDynamics();
    qdd = arm_->getAccelerations();
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override {
    arm_->setPositions(q);
    M = arm_->getMassMatrix();
  }
  std::vector<std::string> steppers() const override { return {"semi_implicit_euler"}; }
  void begin(const std::string&, const VectorXd& q, const VectorXd& qd, double dt_s) override {
    if (!world_) {
      world_ = dart::simulation::World::create();
      world_->setGravity(arm_->getGravity());
      world_->addSkeleton(arm_);
    }
    world_->setTimeStep(dt_s);
    arm_->setPositions(q);
    arm_->setVelocities(qd);
    arm_->setForces(VectorXd::Zero(q.size()));
  }
  void step() override { world_->step(); }

 private:
  dd::SkeletonPtr arm_;
  VectorXd damping_;
  dart::simulation::WorldPtr world_;
};

}  // namespace

std::unique_ptr<Peer> make_dart(const model::Chain& chain) {
  return std::make_unique<Dart>(translate(chain), chain);
}
std::unique_ptr<Peer> read_dart(const std::string& urdf, const model::Chain& chain) {
  return std::make_unique<Dart>(load(urdf, chain), chain);
}

}  // namespace hamel::peers
