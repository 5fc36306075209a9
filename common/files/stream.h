#pragma once
/// Obstacle streams as files.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/scene/stream.h"

namespace hamel::files {

/// What a stream's file holds, in its own frame and time.
struct StreamFile {
  std::vector<scene::StreamSample> samples;  ///< by time
  std::vector<double> empty_s;               ///< times at which nothing is there
  double first_s = 0;                        ///< the earliest time of both
};

/// A stream's file, or every problem.
///
/// NAME.mcap: the obstacle sets of `topic` (full or short name), of one source; the time of a set is its
/// sample time.  A set that is not later than the one before (said again, or of a run begun anew) is passed
/// over.  One that promises to hold (all velocities zero, no successor within half a second) is repeated each
/// half second until its successor's time or the end of the recording, so that its silence is no gap.  A
/// damaged recording is refused: `hamel log recover` makes it whole.  Anything else: CSV, see
/// scene::parse_stream().
Checked<StreamFile> load_stream(const std::string& path, const std::string& topic);

}  // namespace hamel::files
