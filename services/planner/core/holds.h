#pragma once
/// What pairs and obstacles remember from cycle to cycle: the axis to turn about, so that a side once chosen
/// is kept.

#include <Eigen/Core>
#include <span>

#include "services/planner/core/memory.h"
#include "services/planner/core/pairs.h"

namespace hamel::planner {

inline constexpr double kPairHold_s = 0.3;  // planner.md 1.5
inline constexpr double kTurnHold_s = 0.5;  // planner.md 1.8

inline Eigen::Vector3d vector(const Triple& t) { return {t[0], t[1], t[2]}; }
inline Triple triple(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

/// What a pair (an obstacle) remembers, or null where it was not active within the hold time before t_s.
const HeldPair* held_pair(const Memory& memory, int shape, std::uint32_t obstacle, double t_s) noexcept;
const HeldTurn* held_turn(const Memory& memory, std::uint32_t obstacle, double t_s) noexcept;

/// Writes the axes and normals of this cycle's pairs over the table, drops what is older than the hold time
/// and, when the table is full, what is not active now.  `pairs` in their order; `scratch` as large as the
/// table.
void remember_pairs(Memory& memory, std::span<const Pair> pairs, double t_s,
                    std::span<HeldPair> scratch) noexcept;
/// The same for one obstacle's circulation axis; when the table is full the one unseen longest makes room.
void remember_turn(Memory& memory, std::uint32_t obstacle, const Eigen::Vector3d& axis, double t_s) noexcept;

}  // namespace hamel::planner
