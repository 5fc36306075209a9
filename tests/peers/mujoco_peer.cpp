// MuJoCo.
#include <mujoco/mujoco.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "tests/peers/peer.h"

namespace hamel::peers {

namespace {

/// Files in memory; the first is the one that is loaded.
using MujocoFiles = std::vector<std::pair<std::string, std::string>>;

constexpr int kDepth = 80;  // bodies nested in one file: its XML reader goes down to 100 elements

std::string text(double v) {
  char out[32];
  std::snprintf(out, sizeof out, "%.17g ", v);
  return out;
}
std::string text(const Eigen::Vector3d& v) { return text(v.x()) + text(v.y()) + text(v.z()); }
std::string text(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return text(q.w()) + text(q.x()) + text(q.y()) + text(q.z());
}

std::string inertial(const model::Inertia& body) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(body.about_com_kgm2);
  Eigen::Matrix3d R = eigen.eigenvectors();
  if (R.determinant() < 0) R.col(0) = -R.col(0);
  return "<inertial mass='" + text(body.mass_kg) + "' pos='" + text(body.com_m) + "' quat='" + text(R) +
         "' diaginertia='" + text(Eigen::Vector3d(eigen.eigenvalues())) + "'/>";
}

/// Bodies from `first` on, nested; the rest is left to an included file.
std::string bodies(const model::Chain& chain, int first) {
  const int end = std::min(chain.n(), first + kDepth);
  std::string xml;
  for (int i = first; i < end; ++i) {
    const lie::Pose X = joint_pose(chain, i);
    xml += "<body pos='" + text(X.p) + "' quat='" + text(X.R) + "'><joint type='" +
           (prismatic(chain, i) ? "slide" : "hinge") + "' axis='" + text(chain.joint(i).axis) +
           "' armature='" + text(chain.joint(i).armature) + "'/>" + inertial(chain.link(i).inertia);
  }
  if (end < chain.n()) xml += "<include file='from" + std::to_string(end) + ".xml'/>";
  for (int i = first; i < end; ++i) xml += "</body>";
  return xml;
}

MujocoFiles translate(const model::Chain& chain) {
  MujocoFiles files;
  files.emplace_back("arm.xml",
                     "<mujoco><compiler angle='radian' inertiafromgeom='false'/><option gravity='" +
                         text(chain.gravity_W_mps2()) +
                         "'><flag constraint='disable' contact='disable' limit='disable' equality='disable' "
                         "frictionloss='disable' sensor='disable' warmstart='disable'/></option><worldbody>" +
                         bodies(chain, 0) + "</worldbody></mujoco>");
  for (int i = kDepth; i < chain.n(); i += kDepth)
    files.emplace_back("from" + std::to_string(i) + ".xml",
                       "<mujocoinclude>" + bodies(chain, i) + "</mujocoinclude>");
  return files;
}

/// Model and data; constraints, contacts and joint damping are off.
class Mujoco final : public Peer {
 public:
  explicit Mujoco(const MujocoFiles& files) {
    const auto vfs = std::make_unique<mjVFS>();
    mj_defaultVFS(vfs.get());
    for (const auto& [name, content] : files) {
      mj_makeEmptyFileVFS(vfs.get(), name.c_str(), static_cast<int>(content.size()));
      std::memcpy(vfs->filedata[mj_findFileVFS(vfs.get(), name.c_str())], content.data(), content.size());
    }
    char why[1000] = "";
    m_.reset(mj_loadXML(files.front().first.c_str(), vfs.get(), why, sizeof why));
    mj_deleteVFS(vfs.get());
    if (!m_) throw std::runtime_error(std::string("MuJoCo: ") + why);
    d_.reset(mj_makeData(m_.get()));
    m_->opt.disableflags |= mjDSBL_CONSTRAINT;
    damping_ = Eigen::Map<VectorXd>(m_->dof_damping, m_->nv);
    std::fill_n(m_->dof_damping, m_->nv, 0.0);
  }
  std::string name() const override { return "MuJoCo"; }
  VectorXd damping() const override { return damping_; }
  std::string joint(int i) const { return mj_id2name(m_.get(), mjOBJ_JOINT, i); }
  void set_gravity(const Eigen::Vector3d& g_mps2) { copy(g_mps2, m_->opt.gravity); }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    set(q, qd);
    copy(qdd, d_->qacc);
    mj_inverse(m_.get(), d_.get());
    tau = Eigen::Map<VectorXd>(d_->qfrc_inverse, q.size());
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    set(q, qd);
    copy(tau, d_->qfrc_applied);
    mj_forward(m_.get(), d_.get());
    qdd = Eigen::Map<VectorXd>(d_->qacc, q.size());
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override {
    copy(q, d_->qpos);
    mj_fwdPosition(m_.get(), d_.get());
    M.resize(q.size(), q.size());
    mj_fullM(m_.get(), M.data(), d_->qM);  // symmetric: its rows are our columns
  }
  std::vector<std::string> steppers() const override { return {"Euler", "RK4", "implicit"}; }
  void begin(const std::string& stepper, const VectorXd& q, const VectorXd& qd, double dt_s) override {
    m_->opt.integrator = stepper == "RK4" ? mjINT_RK4 : stepper == "implicit" ? mjINT_IMPLICIT : mjINT_EULER;
    m_->opt.timestep = dt_s;
    set(q, qd);
    copy(VectorXd::Zero(q.size()), d_->qfrc_applied);
  }
  void step() override { mj_step(m_.get(), d_.get()); }

 private:
  struct Free {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  static void copy(const VectorXd& from, mjtNum* to) {
    std::memcpy(to, from.data(), sizeof(double) * static_cast<std::size_t>(from.size()));
  }
  void set(const VectorXd& q, const VectorXd& qd) {
    copy(q, d_->qpos);
    copy(qd, d_->qvel);
  }
  std::unique_ptr<mjModel, Free> m_;
  std::unique_ptr<mjData, Free> d_;
  VectorXd damping_;
};

}  // namespace

std::unique_ptr<Peer> make_mujoco(const model::Chain& chain) {
  return std::make_unique<Mujoco>(translate(chain));
}
std::unique_ptr<Peer> read_mujoco(const std::string& urdf, const model::Chain& chain) {
  auto peer = std::make_unique<Mujoco>(MujocoFiles{{"robot.urdf", urdf}});
  if (peer->damping().size() != chain.n()) throw std::runtime_error("MuJoCo reads another robot");
  for (int i = 0; i < chain.n(); ++i)
    if (peer->joint(i) != chain.joint(i).name) throw std::runtime_error("MuJoCo reads other joints");
  peer->set_gravity(chain.gravity_W_mps2());
  return peer;
}

}  // namespace hamel::peers
