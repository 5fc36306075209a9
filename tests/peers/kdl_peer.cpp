// Orocos KDL.  Debian's reader of robots for it, kdl_parser, needs ROS; what it does is done here: urdfdom
// reads the file, its numbers go into a KDL::Tree.
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfdsolver_recursive_newton_euler.hpp>
#include <kdl/chainhdsolver_vereshchagin.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <kdl/tree.hpp>
#include <kdl/treeidsolver_recursive_newton_euler.hpp>

#include <Eigen/Cholesky>
#include <stdexcept>

#include "tests/peers/peer.h"

namespace hamel::peers {

namespace {

KDL::Vector vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

KDL::Frame frame(const lie::Pose& X) {
  const Eigen::Matrix3d& R = X.R;
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)),
          vector(X.p)};
}

KDL::Chain translate(const model::Chain& chain) {
  KDL::Chain out;
  for (int i = 0; i < chain.n(); ++i) {
    const lie::Pose X_PJ = joint_pose(chain, i);
    const model::Inertia& body = chain.link(i).inertia;
    const Eigen::Matrix3d& I = body.about_com_kgm2;
    const KDL::Joint joint(
        std::string("j").append(std::to_string(i)), vector(X_PJ.p), vector(X_PJ.R * chain.joint(i).axis),
        prismatic(chain, i) ? KDL::Joint::TransAxis : KDL::Joint::RotAxis, 1, 0, chain.joint(i).armature);
    const KDL::RotationalInertia moments(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
    out.addSegment(
        KDL::Segment(joint, frame(X_PJ), KDL::RigidBodyInertia(body.mass_kg, vector(body.com_m), moments)));
  }
  return out;
}

class Kdl : public Peer {
 public:
  explicit Kdl(const model::Chain& chain)
      : chain_(translate(chain)),
        gravity_(vector(chain.gravity_W_mps2())),
        inverse_(chain_, gravity_),
        forward_(chain_, gravity_),
        parameters_(chain_, gravity_),
        q_(n()),
        qd_(n()),
        in_(n()),
        out_(n()),
        M_(n()),
        wrenches_(chain_.getNrOfSegments(), KDL::Wrench::Zero()) {}
  std::string name() const override { return "KDL"; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    q_.data = q, qd_.data = qd, in_.data = qdd;
    inverse_.CartToJnt(q_, qd_, in_, wrenches_, out_);
    tau = out_.data;
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    q_.data = q, qd_.data = qd, in_.data = tau;
    forward_.CartToJnt(q_, qd_, in_, wrenches_, out_);
    qdd = out_.data;
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override {
    q_.data = q;
    parameters_.JntToMass(q_, M_);
    M = M_.data;
  }

 protected:
  unsigned n() const { return chain_.getNrOfJoints(); }
  const KDL::Chain chain_;
  const KDL::Vector gravity_;
  KDL::ChainIdSolver_RNE inverse_;
  KDL::ChainFdSolver_RNE forward_;
  KDL::ChainDynParam parameters_;
  KDL::JntArray q_, qd_, in_, out_;
  KDL::JntSpaceInertiaMatrix M_;
  KDL::Wrenches wrenches_;
};

/// The solver of hybrid dynamics with one constraint of no direction: plain forward dynamics.
class KdlVereshchagin final : public Kdl {
 public:
  explicit KdlVereshchagin(const model::Chain& chain)
      : Kdl(chain),
        hybrid_(chain_, KDL::Twist(-gravity_, KDL::Vector::Zero()), 1),
        directions_(1),
        beta_(1),
        constraint_torques_(n()) {
    KDL::SetToZero(directions_);
  }
  std::string name() const override { return "KDL_Vereshchagin"; }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    q_.data = q, qd_.data = qd, in_.data = tau;
    hybrid_.CartToJnt(q_, qd_, out_, directions_, beta_, wrenches_, in_, constraint_torques_);
    qdd = out_.data;
  }

 private:
  KDL::ChainHdSolver_Vereshchagin hybrid_;
  KDL::Jacobian directions_;
  KDL::JntArray beta_, constraint_torques_;
};

KDL::Vector vector(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }
KDL::Frame frame(const urdf::Pose& X) {
  const urdf::Rotation& q = X.rotation;
  return {KDL::Rotation::Quaternion(q.x, q.y, q.z, q.w), vector(X.position)};
}

/// Moments of a URDF are about the centre of mass, in the axes of the inertial's origin.
KDL::RigidBodyInertia inertia(const urdf::Link& link) {
  if (!link.inertial) return KDL::RigidBodyInertia::Zero();
  const urdf::Inertial& i = *link.inertial;
  const KDL::Frame X = frame(i.origin);
  const KDL::RigidBodyInertia turned =
      X.M * KDL::RigidBodyInertia(0, KDL::Vector::Zero(),
                                  KDL::RotationalInertia(i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz));
  return KDL::RigidBodyInertia(i.mass, X.p, turned.getRotationalInertia());
}

KDL::Joint joint(const urdf::Joint& j) {
  const KDL::Frame X = frame(j.parent_to_joint_origin_transform);
  const KDL::Vector axis = X.M * vector(j.axis);
  switch (j.type) {
    case urdf::Joint::REVOLUTE:
    case urdf::Joint::CONTINUOUS:
      return {j.name, X.p, axis, KDL::Joint::RotAxis};
    case urdf::Joint::PRISMATIC:
      return {j.name, X.p, axis, KDL::Joint::TransAxis};
    default:
      return KDL::Joint(j.name, KDL::Joint::Fixed);
  }
}

/// The link and all that hangs on it.
void add(const urdf::Link& link, KDL::Tree& tree) {
  for (const auto& child : link.child_links) {
    const urdf::Joint& j = *child->parent_joint;
    tree.addSegment(
        KDL::Segment(child->name, joint(j), frame(j.parent_to_joint_origin_transform), inertia(*child)),
        link.name);
    add(*child, tree);
  }
}

KDL::Tree load(const std::string& text, const model::Chain& chain) {
  const auto robot = urdf::parseURDF(text);
  if (!robot) throw std::runtime_error("urdfdom reads no robot");
  KDL::Tree tree(robot->getRoot()->name);
  add(*robot->getRoot(), tree);
  if (tree.getNrOfJoints() != static_cast<unsigned>(chain.n()))
    throw std::runtime_error("KDL has another robot");
  for (const auto& [name, element] : tree.getSegments()) {
    const KDL::Joint& j = element.segment.getJoint();
    if (j.getType() != KDL::Joint::Fixed && j.getName() != chain.joint(static_cast<int>(element.q_nr)).name)
      throw std::runtime_error("KDL has other joints");
  }
  return tree;
}

/// A robot with all its branches.  KDL has inverse dynamics of trees alone: the rest follows from it.
class KdlTree final : public Peer {
 public:
  KdlTree(const std::string& text, const model::Chain& chain)
      : tree_(load(text, chain)),
        inverse_(tree_, vector(chain.gravity_W_mps2())),
        weightless_(tree_, KDL::Vector::Zero()),
        q_(n()),
        qd_(n()),
        qdd_(n()),
        out_(n()) {}
  std::string name() const override { return "KDL"; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    tau = torques(inverse_, q, qd, qdd);
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    MatrixXd M;
    mass_matrix(q, M);
    qdd = M.ldlt().solve(tau - torques(inverse_, q, qd, VectorXd::Zero(q.size())));
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override {
    M.resize(q.size(), q.size());
    const VectorXd zero = VectorXd::Zero(q.size());
    for (Eigen::Index i = 0; i < q.size(); ++i)
      M.col(i) = torques(weightless_, q, zero, VectorXd::Unit(q.size(), i));
  }

 private:
  unsigned n() const { return tree_.getNrOfJoints(); }
  VectorXd torques(KDL::TreeIdSolver_RNE& solver, const VectorXd& q, const VectorXd& qd,
                   const VectorXd& qdd) {
    q_.data = q, qd_.data = qd, qdd_.data = qdd;
    solver.CartToJnt(q_, qd_, qdd_, {}, out_);
    return out_.data;
  }
  const KDL::Tree tree_;
  KDL::TreeIdSolver_RNE inverse_, weightless_;
  KDL::JntArray q_, qd_, qdd_, out_;
};

}  // namespace

std::unique_ptr<Peer> read_kdl(const std::string& urdf, const model::Chain& chain) {
  return std::make_unique<KdlTree>(urdf, chain);
}
std::unique_ptr<Peer> make_kdl(const model::Chain& chain) { return std::make_unique<Kdl>(chain); }
std::unique_ptr<Peer> make_kdl_vereshchagin(const model::Chain& chain) {
  return std::make_unique<KdlVereshchagin>(chain);
}

}  // namespace hamel::peers
