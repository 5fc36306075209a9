#include "tests/peers/peer.h"

namespace hamel::peers {

const std::vector<Maker>& makers() {
  static const std::vector<Maker> all{
#ifdef HAMEL_WITH_KDL
      {"KDL", make_kdl},         {"KDL_Vereshchagin", make_kdl_vereshchagin},
#endif
#ifdef HAMEL_WITH_DART
      {"DART", make_dart},
#endif
#ifdef HAMEL_WITH_MUJOCO
      {"MuJoCo", make_mujoco},
#endif
#ifdef HAMEL_WITH_SIMBODY
      {"Simbody", make_simbody},
#endif
  };
  return all;
}

const std::vector<Reader>& readers() {
  static const std::vector<Reader> all{
#ifdef HAMEL_WITH_KDL
      {"KDL", read_kdl, 1e-10},
#endif
#ifdef HAMEL_WITH_DART
      {"DART", read_dart, 1e-10},
#endif
#ifdef HAMEL_WITH_MUJOCO
      {"MuJoCo", read_mujoco, 1e-8},  // it turns an inertia onto its main axes to about 1e-9
#endif
  };
  return all;
}

}  // namespace hamel::peers
