#pragma once
/// A MuJoCo model from files in memory; the first is the one that is loaded.

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

typedef struct mjModel_ mjModel;
typedef struct mjData_ mjData;

namespace hamel::peers {

using MujocoFiles = std::vector<std::pair<std::string, std::string>>;

struct MujocoModel {
  explicit MujocoModel(const MujocoFiles& files);  ///< throws std::runtime_error with MuJoCo's reason
  ~MujocoModel();
  MujocoModel(const MujocoModel&) = delete;
  MujocoModel& operator=(const MujocoModel&) = delete;
  void inverse_dynamics(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& qdd,
                        Eigen::VectorXd& tau);
  void mass_matrix(const Eigen::VectorXd& q, Eigen::MatrixXd& M);
  int joints() const;
  void disable_constraints();  ///< contacts and joint limits
  mjModel* m = nullptr;
  mjData* d = nullptr;
};

}  // namespace hamel::peers
