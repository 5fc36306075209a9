#pragma once
/// The same arm in somebody else's library: for agreement (tests/peers) and for time (tests/bench).
///
/// Each peer is built through its own API from a chain's numbers: contacts, limits, constraints and sensors
/// are off, joint damping is left out.

#include <Eigen/Core>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "common/model/chain.h"

namespace hamel::peers {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Peer {
 public:
  virtual ~Peer() = default;
  virtual std::string name() const = 0;
  /// False: the library knows no rotor inertia; compare with a chain that has none.
  virtual bool has_armature() const { return true; }
  /// tau = M qdd + c + tau_g.
  virtual void inverse_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& qdd,
                                VectorXd& tau) = 0;
  virtual void forward_dynamics(const VectorXd& q, const VectorXd& qd, const VectorXd& tau,
                                VectorXd& qdd) = 0;
  virtual void mass_matrix(const VectorXd& q, MatrixXd& M) = 0;
  /// Joint damping as read from a file, which the functions above leave out; empty: it reads none.
  virtual VectorXd damping() const { return {}; }

  /// Names of the library's own integrators; begin() chooses one, step() advances by its dt.
  virtual std::vector<std::string> steppers() const { return {}; }
  virtual void begin(const std::string& /*stepper*/, const VectorXd& /*q*/, const VectorXd& /*qd*/,
                     double /*dt_s*/) {}
  virtual void step() {}
};

/// Builders of those peers that were there when this was configured.
struct Maker {
  std::string name;
  std::unique_ptr<Peer> (*make)(const model::Chain&);
};
const std::vector<Maker>& makers();
inline std::ostream& operator<<(std::ostream& out, const Maker& maker) { return out << maker.name; }

/// Builders by the libraries' own readers from the text of a URDF without shapes.  They throw where the
/// joints are not the chain's, in order; of the chain nothing else is used but its gravity.
struct Reader {
  std::string name;
  std::unique_ptr<Peer> (*read)(const std::string& urdf, const model::Chain& chain);
  double tolerance;  ///< as well as the library keeps the file's numbers
};
const std::vector<Reader>& readers();
inline std::ostream& operator<<(std::ostream& out, const Reader& reader) { return out << reader.name; }

std::unique_ptr<Peer> make_kdl(const model::Chain& chain);  ///< Newton-Euler, M by composite bodies, LDL
std::unique_ptr<Peer> make_kdl_vereshchagin(const model::Chain& chain);  ///< forward dynamics in O(n)
std::unique_ptr<Peer> make_dart(const model::Chain& chain);
std::unique_ptr<Peer> make_mujoco(const model::Chain& chain);
std::unique_ptr<Peer> make_simbody(const model::Chain& chain);
std::unique_ptr<Peer> read_kdl(const std::string& urdf, const model::Chain& chain);
std::unique_ptr<Peer> read_dart(const std::string& urdf, const model::Chain& chain);
std::unique_ptr<Peer> read_mujoco(const std::string& urdf, const model::Chain& chain);

/// Pose of link i's frame in link i-1's at q = 0, the base's own pose included.
inline lie::Pose joint_pose(const model::Chain& chain, int i) {
  return i == 0 ? chain.X_WB0() * chain.joint(0).X_PJ : chain.joint(i).X_PJ;
}
inline bool prismatic(const model::Chain& chain, int i) {
  return chain.joint(i).kind == model::JointKind::prismatic;
}

}  // namespace hamel::peers
