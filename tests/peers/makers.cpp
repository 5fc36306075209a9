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

}  // namespace hamel::peers
