// Our URDF reader against those of other libraries, on the same files.  Meshes are absent, so shapes are cut
// out of the text first.
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <sstream>

#include "common/files/urdf.h"
#include "tests/peers/compare.h"
#include "tests/support/data.h"

namespace hamel::peers {
namespace {

std::string without_shapes(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::stringstream all;
  all << in.rdbuf();
  static const std::regex comment("<!--[\\s\\S]*?-->");
  static const std::regex massless("mass value=\"0(\\.0*)?\"");  // we lump such a link, others forget it
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

class Readers : public testing::TestWithParam<Reader> {};
INSTANTIATE_TEST_SUITE_P(Agreement, Readers, testing::ValuesIn(readers()),
                         [](const auto& reader) { return reader.param.name; });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Readers);

TEST_P(Readers, AgreeOnTheFilesOfRobots) {
  HAMEL_NEEDS_DATA("urdf");
  const auto files = test::files_in(test::data_folder() / "urdf", ".urdf");
  ASSERT_FALSE(files.empty());
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const auto robot = files::load_urdf(file);
    ASSERT_TRUE(robot) << to_string(robot.error().front());
    const model::Chain& chain = robot.value().chain;
    const auto peer = GetParam().read(without_shapes(file), chain);
    for (Eigen::Index i = 0; i < peer->damping().size(); ++i)
      EXPECT_EQ(peer->damping()[i], chain.joint(static_cast<int>(i)).damping) << "joint " << i;
    test::Random rng(11);
    for (int k = 0; k < 20; ++k) compare(*peer, chain, rng, GetParam().tolerance);
  }
}

}  // namespace
}  // namespace hamel::peers
