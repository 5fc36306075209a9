// Orocos KDL.
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfdsolver_recursive_newton_euler.hpp>
#include <kdl/chainhdsolver_vereshchagin.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

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

}  // namespace

std::unique_ptr<Peer> make_kdl(const model::Chain& chain) { return std::make_unique<Kdl>(chain); }
std::unique_ptr<Peer> make_kdl_vereshchagin(const model::Chain& chain) {
  return std::make_unique<KdlVereshchagin>(chain);
}

}  // namespace hamel::peers
