#pragma once
/// A recorded obstacle stream as numbers, and the strict reader of its text.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/geometry/shape.h"

namespace hamel::scene {

/// One obstacle of a stream at one time: a row of a CSV, a member of a recorded set.
struct StreamSample {
  double t_s = 0;
  std::uint32_t id = 0;
  Eigen::Vector3d p_m = Eigen::Vector3d::Zero();  ///< of the shape's frame, in the stream's
  geometry::Shape shape;
  Eigen::Matrix3d R_SO = Eigen::Matrix3d::Identity();
  double sigma_m = 0;
};

/// The header a stream's text must begin with.
inline constexpr std::string_view kStreamHeader = "t_s,id,x_m,y_m,z_m,radius_m";

/// The samples of a stream's text, spheres, or every bad line as "name:line".  Rules: the header is
/// kStreamHeader; each row has six numbers, all finite; t_s never decreases; radius_m >= 0; an id occurs once
/// per time; at least one row.  Lines may end in CR LF; empty lines and lines that begin with # are passed
/// over.  Stops listing after 20 problems.
Checked<std::vector<StreamSample>> parse_stream(std::string_view text, const std::string& name);

}  // namespace hamel::scene
