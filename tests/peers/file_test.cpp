// Our URDF reader against MuJoCo's, on the same files.  Meshes are absent, so shapes are cut out of the text
// first.
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <sstream>

#include "common/files/urdf.h"
#include "common/rbd/rbd.h"
#include "tests/peers/mujoco_model.h"
#include "tests/support/chains.h"
#include "tests/support/data.h"

namespace hamel::peers {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTolerance = 1e-8;  // MuJoCo turns an inertia onto its main axes to about 1e-9

std::string without_shapes(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::stringstream all;
  all << in.rdbuf();
  static const std::regex comment("<!--[\\s\\S]*?-->");
  static const std::regex massless("mass value=\"0(\\.0*)?\"");  // we lump such a link, MuJoCo forgets it
  const std::string bare =
      std::regex_replace(std::regex_replace(all.str(), comment, ""), massless, "mass value=\"1e-13\"");
  std::string out;
  for (std::size_t at = 0; at < bare.size();) {
    const std::size_t visual = bare.find("<visual", at), collision = bare.find("<collision", at);
    const std::size_t begin = std::min(visual, collision);
    out += bare.substr(at, begin - at);
    if (begin == std::string::npos) break;
    const std::string end = visual < collision ? "</visual>" : "</collision>";
    at = bare.find(end, begin) + end.size();
  }
  return out;
}

TEST(MujocoReadsTheSameRobot, FromTheFile) {
  HAMEL_NEEDS_DATA("urdf");
  for (const std::string& file : test::files_in(test::data_folder() / "urdf", ".urdf")) {
    SCOPED_TRACE(file);
    const auto robot = files::load_urdf(file);
    ASSERT_TRUE(robot) << to_string(robot.error().front());
    model::ChainSpec spec = robot.value().chain.spec();
    const int n = static_cast<int>(spec.joints.size());
    MujocoModel theirs({{"robot.urdf", without_shapes(file)}});
    theirs.disable_constraints();
    ASSERT_EQ(theirs.joints(), n);
    const model::Chain chain = test::checked(spec);
    rbd::Workspace ws(chain);
    test::Random rng(11);
    for (int k = 0; k < 20; ++k) {
      const VectorXd q = rng.vector(n, 3), qd = rng.vector(n, 2), qdd = rng.vector(n, 5);
      MatrixXd M(n, n), M_peer;
      rbd::positions(chain, q, ws);
      rbd::mass_matrix(chain, ws, M);
      theirs.mass_matrix(q, M_peer);
      EXPECT_LE((M - M_peer).norm(), kTolerance * M.norm());
      VectorXd tau(n), tau_peer, damping(n);
      for (int i = 0; i < n; ++i) damping[i] = chain.joint(i).damping;
      rbd::inverse_dynamics(chain, q, qd, qdd, ws, tau);
      theirs.inverse_dynamics(q, qd, qdd, tau_peer);  // its joints damp, our inverse dynamics leaves that out
      EXPECT_LE((tau + damping.cwiseProduct(qd) - tau_peer).norm(), kTolerance * tau.norm());
    }
  }
}

}  // namespace
}  // namespace hamel::peers
