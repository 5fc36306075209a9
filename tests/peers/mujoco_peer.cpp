// MuJoCo.
#include <mujoco/mujoco.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cstring>
#include <stdexcept>

#include "tests/peers/mujoco_model.h"
#include "tests/peers/peer.h"

namespace hamel::peers {

namespace {

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

class Mujoco final : public Peer {
 public:
  explicit Mujoco(const model::Chain& chain) : model_(translate(chain)) {}
  std::string name() const override { return "MuJoCo"; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd, VectorXd& tau) override {
    model_.inverse_dynamics(q, qd, qdd, tau);
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau, VectorXd& qdd) override {
    set(q, qd);
    copy(tau, model_.d->qfrc_applied);
    mj_forward(model_.m, model_.d);
    qdd = Eigen::Map<VectorXd>(model_.d->qacc, q.size());
  }
  void mass_matrix(const VectorXd& q, MatrixXd& M) override { model_.mass_matrix(q, M); }
  std::vector<std::string> steppers() const override { return {"Euler", "RK4", "implicit"}; }
  void begin(const std::string& stepper, const VectorXd& q, const VectorXd& qd, double dt_s) override {
    model_.m->opt.integrator = stepper == "RK4"        ? mjINT_RK4
                               : stepper == "implicit" ? mjINT_IMPLICIT
                                                       : mjINT_EULER;
    model_.m->opt.timestep = dt_s;
    set(q, qd);
    copy(VectorXd::Zero(q.size()), model_.d->qfrc_applied);
  }
  void step() override { mj_step(model_.m, model_.d); }

 private:
  static void copy(const VectorXd& from, mjtNum* to) {
    std::memcpy(to, from.data(), sizeof(double) * static_cast<std::size_t>(from.size()));
  }
  void set(const VectorXd& q, const VectorXd& qd) {
    copy(q, model_.d->qpos);
    copy(qd, model_.d->qvel);
  }
  MujocoModel model_;
};

}  // namespace

MujocoModel::MujocoModel(const MujocoFiles& files) {
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  for (const auto& [name, content] : files) {
    mj_makeEmptyFileVFS(vfs.get(), name.c_str(), static_cast<int>(content.size()));
    std::memcpy(vfs->filedata[mj_findFileVFS(vfs.get(), name.c_str())], content.data(), content.size());
  }
  char why[1000] = "";
  m = mj_loadXML(files.front().first.c_str(), vfs.get(), why, sizeof why);
  mj_deleteVFS(vfs.get());
  if (m == nullptr) throw std::runtime_error(std::string("MuJoCo: ") + why);
  d = mj_makeData(m);
}

MujocoModel::~MujocoModel() {
  mj_deleteData(d);
  mj_deleteModel(m);
}

int MujocoModel::joints() const { return m->nv; }

void MujocoModel::disable_constraints() { m->opt.disableflags |= mjDSBL_CONSTRAINT; }

void MujocoModel::inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd,
                                   VectorXd& tau) {
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(q.size());
  std::memcpy(d->qpos, q.data(), bytes);
  std::memcpy(d->qvel, qd.data(), bytes);
  std::memcpy(d->qacc, qdd.data(), bytes);
  mj_inverse(m, d);
  tau = Eigen::Map<VectorXd>(d->qfrc_inverse, q.size());
}

void MujocoModel::mass_matrix(const VectorXd& q, MatrixXd& M) {
  std::memcpy(d->qpos, q.data(), sizeof(double) * static_cast<std::size_t>(q.size()));
  mj_fwdPosition(m, d);
  M.resize(q.size(), q.size());
  mj_fullM(m, M.data(), d->qM);  // symmetric: its rows are our columns
}

std::unique_ptr<Peer> make_mujoco(const model::Chain& chain) { return std::make_unique<Mujoco>(chain); }

}  // namespace hamel::peers
