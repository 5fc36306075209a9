#pragma once
/// Where the obstacles are at a time: scripted ones and a recorded stream, sampled anew.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/base/result.h"
#include "common/geometry/shape.h"
#include "common/scene/scene.h"

namespace hamel::perception {

/// A stream that says nothing for longer than this [s of the run] has a gap: nothing is known inside it.
inline constexpr double kLongestSilence_s = 1;
/// A stream is sampled anew at least so often.
inline constexpr double kLeastStreamRate_hz = 30;

/// The obstacles of a scene as a function of time.  Immutable: the same time gives the same bits, in any
/// order of calls and from any thread.
///
/// Scripted: p(t) = p0 + v t, or p0 + a sin(2 pi f t + phase).
/// Stream: time in it is start_s + rate t.  Between two of its times an obstacle moves on the straight line
/// between its two places, with that line's velocity.  An id that is absent from the next time goes on with
/// its last velocity until then and is gone after; one that is seen a single time stands there with its
/// velocity unknown.  Turning and sizes go the same way.  A sample that is reached and left faster than
/// Stream::glitch_mps, while its neighbours fit each other, is wrong: the obstacle goes on between those.  A
/// velocity over that is not used.  Causal streams know nothing of a sample before its time: obstacles go on
/// from their last two, and a wrong one is seen where it says.  Flaws, where the options have them, are the
/// same each time for the same set. Before the first sample and behind the end there is nothing; the end is
/// one sample interval behind the last.
class Source {
 public:
  /// The source, or what scene::problems() says of the options.  Copies the stream's samples.
  static Checked<Source> make(const scene::PerceptionOptions& options);

  /// Puts every obstacle at t_s [s of the run] into `out`: scripted ones in the scene's order, then the
  /// stream's by id.  False inside a gap of the stream: nothing is known and `out` is empty (which is not an
  /// empty set). O(log samples) an obstacle; no allocation once `out` has room for most_obstacles().
  bool at(double t_s, std::vector<geometry::Obstacle>& out) const;

  /// The first time behind t_s at which a set is due: a whole multiple of the period, never inside a gap.
  /// +inf when nothing will change any more; what holds at t = 0 is due at 0.
  double next_time(double t_s) const;

  /// True when the set at 0 holds for ever.
  bool is_static() const noexcept { return !moves_ && frames_.empty(); }
  /// Time between sets [s].
  double period_s() const noexcept { return 1 / rate_hz_; }
  std::size_t most_obstacles() const noexcept { return most_; }
  /// Wrong samples of the stream that the run has come by until t_s.
  std::size_t glitches(double t_s) const;

 private:
  /// The samples of one time, sorted by id; none: nothing is there.
  struct Frame {
    double t_s = 0;
    std::size_t begin = 0, end = 0;
  };

  explicit Source(const scene::PerceptionOptions& options);
  void make_frames();
  void find_glitches();
  double speed_mps(const scene::StreamSample& a, const scene::StreamSample& b) const;
  std::size_t after(std::size_t frame) const;
  double span_s(std::size_t frame) const;
  double seen(double t_s) const;
  double stream_time(double t_s) const;
  std::optional<lie::Twist> velocity(std::size_t frame, std::uint32_t id) const;
  std::size_t frame_at(double stream_t_s) const;
  bool is_gap(std::size_t frame) const;
  bool in_gap(double stream_t_s, double& gap_end_s) const;
  const scene::StreamSample* find(std::size_t frame, std::uint32_t id) const;
  geometry::Obstacle place(std::size_t frame, const scene::StreamSample& sample, double stream_t_s) const;
  double grid_after(double t_s) const;

  std::vector<scene::ScriptedObstacle> scripted_;
  scene::Stream stream_;
  std::optional<scene::Flaws> flaws_;
  std::vector<Frame> frames_;
  std::vector<double> glitch_s_;  ///< stream times of wrong samples, in order
  double rate_hz_ = 0;
  double end_s_ = 0;  ///< stream time at which the last frame is over
  std::size_t most_ = 0;
  bool moves_ = false;  ///< a scripted obstacle does
};

}  // namespace hamel::perception
