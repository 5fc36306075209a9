#pragma once
/// Robots that are compiled in: what deploy/robots holds, wherever the program runs.

#include <string_view>

namespace hamel::client {

/// Text of deploy/robots/panda.urdf.
std::string_view panda_urdf();

}  // namespace hamel::client
