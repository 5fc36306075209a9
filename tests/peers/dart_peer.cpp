// DART.
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/PrismaticJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/simulation/World.hpp>

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

class Dart final : public Peer {
 public:
  explicit Dart(const model::Chain& chain) : arm_(dd::Skeleton::create("arm")) {
    dd::BodyNode* last = nullptr;
    for (int i = 0; i < chain.n(); ++i)
      last = prismatic(chain, i) ? add<dd::PrismaticJoint>(arm_, last, chain, i)
                                 : add<dd::RevoluteJoint>(arm_, last, chain, i);
    arm_->setGravity(chain.gravity_W_mps2());
  }
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
  dart::simulation::WorldPtr world_;
};

}  // namespace

std::unique_ptr<Peer> make_dart(const model::Chain& chain) { return std::make_unique<Dart>(chain); }

}  // namespace hamel::peers
