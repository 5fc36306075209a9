#pragma once
/// A scene as plain numbers: one robot, its goal, the obstacles in its way, and how to run it.
/// Files become scenes in common/files; nothing here reads a file.

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/geometry/shape.h"
#include "common/model/chain.h"
#include "common/scene/options.h"
#include "common/scene/stream.h"

namespace hamel::scene {

/// A solid fixed to a link, for distances.
struct LinkShape {
  int link = -1;  ///< 0..n-1; -1: the base, which does not move
  geometry::Shape shape;
  lie::Pose X_LS;  ///< shape frame in the link's frame
  /// Of the base: once of a link that locked joints made part of it, which nothing that stands may touch.
  bool was_link = false;
};

/// A chain, what surrounds its links, and the text it came from.
struct Robot {
  std::string name;
  std::string urdf;  ///< the file's text, for the wire and for recordings
  model::Chain chain;
  std::vector<LinkShape> shapes;
  std::vector<std::string> warnings =
      {};  ///< what was read otherwise than written, e.g. "link hand: collision mesh not read"
  std::string spheres = {};  ///< text of the sidecar with collision spheres; empty: none
  int fixed_joints = 0;      ///< of the file, lumped
  /// Indices of shapes that must not touch each other, that of the link nearer to the base first; see
  /// watch().
  std::vector<std::pair<std::size_t, std::size_t>> self_pairs = {};
};

enum class GoalKind : std::uint8_t { position, pose, joints };

/// Where the end effector (or every joint) should go.
struct Goal {
  std::uint64_t id = 0;  ///< newest id wins; the scene's own is 1
  GoalKind kind = GoalKind::position;
  lie::Pose X_WG;                        ///< position: only p; world frame
  lie::Twist V_WG = lie::Twist::Zero();  ///< motion of the target, world axes
  Eigen::VectorXd joints;                ///< kind joints: n values [rad or m]
};

/// A scripted obstacle: where it is at t = 0 and how it moves.  Exactly one motion.
struct ScriptedObstacle {
  geometry::Obstacle at_start;
  Eigen::Vector3d velocity_mps = Eigen::Vector3d::Zero();  ///< constant velocity, or
  Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();   ///< p(t) = p0 + amplitude sin(2 pi f t + phase)
  double frequency_hz = 0;
  double phase_rad = 0;
};

/// A recorded obstacle stream, placed in the world: CSV t_s,id,x_m,y_m,z_m,radius_m, or the obstacle sets of
/// a recording (MCAP).
struct Stream {
  std::string path;                 ///< as found: absolute, or relative to the working directory
  std::string topic = "obstacles";  ///< of a recording, full or short name
  lie::Pose X_WS;                   ///< stream frame in the world
  double scale = 1;                 ///< of lengths, > 0
  double rate = 1;                  ///< stream seconds per run second, > 0
  double start_s = 0;               ///< stream time at run time 0
  double until_s = std::numeric_limits<double>::infinity();  ///< later samples are left out, >= the first's
  bool loop = false;                  ///< begins anew, one sample interval behind its end
  double glitch_mps = 10;             ///< a larger speed between two samples is taken for a wrong sample, > 0
  bool causal = false;                ///< nothing is known of a sample before its time
  std::vector<StreamSample> samples;  ///< what the file holds, in stream frame and stream time
  std::vector<double> empty_s;        ///< times at which it says that nothing is there
};

/// What a sensor does to the truth, on purpose: to test the planner.  Same seed, same flaws.
struct Flaws {
  std::uint64_t seed = 1;
  double noise_m = 0;    ///< standard deviation of each coordinate of a position, >= 0
  double dropout = 0;    ///< probability that an obstacle is missing in a set, in [0, 1]
  double latency_s = 0;  ///< a set shows what was so long before its stamp, >= 0
  Eigen::Vector3d eye_m = Eigen::Vector3d::Zero();           ///< the field of view: from here, world
  Eigen::Vector3d look = Eigen::Vector3d::UnitX();           ///< in this direction, not zero, world
  double view_rad = 3.141592653589793;                       ///< centres within this angle of it, in (0, pi]
  double range_m = std::numeric_limits<double>::infinity();  ///< and this distance are seen, > 0
};

struct PerceptionOptions {
  double rate_hz = 30;  ///< obstacle sets per second, > 0; static scenes publish on change
  std::vector<ScriptedObstacle> obstacles;
  std::optional<Stream> stream;
  std::optional<Flaws> flaws;
};

/// The bus each service talks over: "inproc", "fastdds" or "cyclonedds"; empty: whatever the program was
/// told.
struct Buses {
  std::string dynamics, planner, perception;
};

/// A joint that does not move in this scene.
struct Lock {
  std::string joint;            ///< its name
  std::optional<double> value;  ///< where it stays [rad or m]; none: its start
};

/// One thing that a scene does not need, and what became of it.
struct Reduction {
  std::string name;   ///< of the field in `reduce { }`, or "fixed"
  bool exact = true;  ///< false: the result changes, by `bound` at most
  bool in_force = false;
  std::string what, why;  ///< "2 of 9 joints frozen"; why it may be done, or why it is not
  double before = 0, after = 0;
  std::string unit;  ///< of before and after
  double bound = 0;  ///< of a bounded one that is in force
  std::string bound_unit = {};
  bool live = false;  ///< goes by what happens in the run, whatever its sizes at the start
};

/// Where the reduction `cycle` made a planner cycle longer than written: as often as written while the arm is
/// fast (cadence.h).
struct Hurry {
  int period_steps = 0;  ///< as written; 0: no cycle was made longer
  double mps = kInf;     ///< in force while a point of the arm is faster
};

/// One run.
struct Scene {
  std::string name;
  std::string text;       ///< the file's text after --set, for recordings
  std::uint32_t arm = 1;  ///< key of the arm on the wire
  Robot robot;
  Eigen::VectorXd q0, qd0;   ///< start [rad, rad/s], sizes n
  std::optional<Goal> goal;  ///< none: the arm is not steered and the planner stays IDLE
  bool steered = true;       ///< false: free motion, no planner, no perception (5.1)
  DynamicsOptions dynamics;
  PlannerOptions planner;
  PerceptionOptions perception;
  Buses bus;
  double duration_s = 10;  ///< length of the run, > 0
  StopRule stop = StopRule::when_reached;
  ReduceOptions reduce = {};
  Accuracy accuracy = {};
  std::vector<Lock> locked = {};
  Hurry hurry = {};
  std::vector<Reduction> reductions = {};  ///< what reduce() did and did not; empty: the scene as written
};

/// Every violated rule across the scene: sizes, options, shapes, streams.  Empty when valid.  `where` is the
/// path of the field in the text format, e.g. "perception.obstacles[2].sphere.radius_m".
Problems problems(const Scene& s);
Problems problems(const PerceptionOptions& o);

/// A number of the scene's text and robot: what a checkpoint of a run must agree with.
std::uint64_t fingerprint(const Scene& s);

/// What is allowed but probably not meant: the robot's warnings and settings that undo each other.
std::vector<std::string> warnings(const Scene& s);

const char* to_string(GoalKind v);

}  // namespace hamel::scene
