#pragma once
/// Everything of the planner that crosses from one cycle to the next: plain bytes of a fixed size, so that a
/// checkpoint of it and a restart from it continue bit for bit.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace hamel::planner {

inline constexpr std::size_t kMaxPairs = 256;      ///< pairs of (link shape, obstacle) acted on in one cycle
inline constexpr std::size_t kMaxTurns = 64;       ///< obstacles whose circulation direction is held
inline constexpr std::size_t kMaxSightings = 128;  ///< obstacles of unknown velocity that are watched
inline constexpr std::size_t kMaxWaypoint = 64;    ///< joints of a waypoint

using Triple = std::array<double, 3>;

/// Turning axis and normal a pair keeps while it is active; planner.md 1.5.
struct HeldPair {
  std::uint64_t shape = 0, obstacle = 0;  ///< the key; the table is sorted by it
  double seen_s = 0;                      ///< when last active
  Triple axis{};                          ///< unit; zero: none chosen yet
  Triple normal{};                        ///< unit, toward the obstacle
};

/// Direction of circulation round one obstacle, shared by all links; planner.md 1.8.
struct HeldTurn {
  std::uint64_t obstacle = 0;  ///< the key; the table is sorted by it
  double seen_s = 0;
  Triple axis{};
};

/// What the sightings of an obstacle told: its place, from the second one on its velocity too.
enum class Known : std::uint64_t { place, velocity, nothing };

/// Where an obstacle of unknown velocity was last seen, and how fast it seems to move.
struct Sighting {
  std::uint64_t obstacle = 0;  ///< the key
  double stamp_s = 0;
  Triple at{}, velocity{};
  Known known = Known::place;
};

/// A configuration to pass on the way to the goal.
struct Waypoint {
  std::uint64_t set = 0;         ///< 1: on the way to it
  std::uint64_t asked = 0;       ///< questions asked at this goal so far
  std::uint64_t asked_step = 0;  ///< of the last question
  std::uint64_t waiting = 0;     ///< 1: the last question has no answer yet
  double asked_s = 0;            ///< sample time of the last question
  double since_s = 0;            ///< on the way since
  std::array<double, kMaxWaypoint> q{};
};

/// Copy it, save it, load it.  Every field is eight bytes wide: there is no padding to differ.  Whoever
/// changes a field or what it means raises kKind in resume.cpp.
struct Memory {
  std::uint64_t cycles = 0;             ///< plan() calls
  std::uint64_t state = 0, reason = 0;  ///< of the last report (State, Reason)
  std::uint64_t goal_id = 0;
  std::uint64_t goal_started = 0;  ///< 1 once a cycle has seen the goal
  double goal_start_s = 0;         ///< sample time of that cycle
  std::uint64_t contacts = 0;      ///< cycles with clearance < 0
  double clearance_min_m = std::numeric_limits<double>::infinity();
  double path_length_m = 0;
  std::uint64_t tip_known = 0;
  Triple tip_m{};              ///< end effector in the last cycle
  double within_since_s = -1;  ///< inside tolerance and slow since then; < 0: not
  double time_to_goal_s = -1;
  double best_error = 0;  ///< smallest scaled error that counted as progress
  double progress_s = 0;  ///< when that was
  double fast_s = 0;      ///< when the arm last moved faster than `goal_speed`
  double turn_error = 0;  ///< scaled error the flip timer compares with
  double turn_s = 0;      ///< when the flip timer started
  double pressed_s =
      -std::numeric_limits<double>::infinity();  ///< when the attraction last pressed on something
  std::uint64_t flips = 0;                       ///< since the last progress
  double infeasible_s = -std::numeric_limits<double>::infinity();  ///< when the barrier last gave up
  double ramp_start_s = -1;                                        ///< < 0: no ramp
  std::uint64_t ramp_asked = 0;                                    ///< 1: starts with the next cycle
  double tank_J = 0,
         tank_full_J = -1;  ///< what circulation may still spend, and at the start; < 0: not yet set
  std::uint64_t held_count = 0, turn_count = 0;
  std::array<HeldPair, kMaxPairs> held{};
  std::array<HeldTurn, kMaxTurns> turns{};
  std::uint64_t sighting_count = 0;
  std::array<Sighting, kMaxSightings> sightings{};
  Waypoint waypoint;
};
static_assert(std::is_trivially_copyable_v<Memory>);
static_assert(sizeof(HeldPair) == 9 * 8 && sizeof(HeldTurn) == 5 * 8);
static_assert(sizeof(Sighting) == 9 * 8 && sizeof(Waypoint) == (6 + kMaxWaypoint) * 8);

}  // namespace hamel::planner
