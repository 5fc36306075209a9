#include "services/planner/core/holds.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace hamel::planner {
namespace {

auto key(const HeldPair& h) { return std::tie(h.shape, h.obstacle); }

bool recent(double seen_s, double t_s, double hold_s) { return std::abs(t_s - seen_s) < hold_s; }

std::span<const HeldPair> table(const Memory& m) { return {m.held.data(), m.held_count}; }

}  // namespace

const HeldPair* held_pair(const Memory& memory, int shape, std::uint32_t obstacle, double t_s) noexcept {
  const HeldPair wanted{.shape = static_cast<std::uint64_t>(shape), .obstacle = obstacle};
  const auto held = table(memory);
  const auto it = std::lower_bound(held.begin(), held.end(), wanted,
                                   [](const HeldPair& a, const HeldPair& b) { return key(a) < key(b); });
  if (it == held.end() || key(*it) != key(wanted) || !recent(it->seen_s, t_s, kPairHold_s)) return nullptr;
  return &*it;
}

const HeldTurn* held_turn(const Memory& memory, std::uint32_t obstacle, double t_s) noexcept {
  for (std::size_t k = 0; k < memory.turn_count; ++k) {
    const HeldTurn& turn = memory.turns[k];
    if (turn.obstacle == obstacle) return recent(turn.seen_s, t_s, kTurnHold_s) ? &turn : nullptr;
  }
  return nullptr;
}

// A merge of two sorted lists: the pairs of now, and those of before that are still held.
void remember_pairs(Memory& memory, std::span<const Pair> pairs, double t_s,
                    std::span<HeldPair> scratch) noexcept {
  const auto old = table(memory);
  std::size_t spare = scratch.size() - std::min(scratch.size(), pairs.size());
  std::size_t count = 0, k = 0;
  const auto keep_until = [&](const HeldPair* next) {
    for (; k < old.size() && (!next || key(old[k]) <= key(*next)); ++k) {
      const bool replaced = next && key(old[k]) == key(*next);
      if (replaced || spare == 0 || !recent(old[k].seen_s, t_s, kPairHold_s)) continue;
      scratch[count++] = old[k];
      --spare;
    }
  };
  for (const Pair& pair : pairs) {
    const HeldPair now{static_cast<std::uint64_t>(pair.shape), pair.obstacle, t_s, triple(pair.axis),
                       triple(pair.n)};
    if (count > 0 && key(scratch[count - 1]) == key(now))
      continue;  // two obstacles of one id: the first counts
    keep_until(&now);
    scratch[count++] = now;
  }
  keep_until(nullptr);
  std::copy_n(scratch.begin(), count, memory.held.begin());
  std::fill(memory.held.begin() + static_cast<std::ptrdiff_t>(count), memory.held.end(), HeldPair{});
  memory.held_count = count;
}

void remember_turn(Memory& memory, std::uint32_t obstacle, const Eigen::Vector3d& axis, double t_s) noexcept {
  const auto begin = memory.turns.begin(), end = begin + static_cast<std::ptrdiff_t>(memory.turn_count);
  auto at = std::find_if(begin, end, [&](const HeldTurn& h) { return h.obstacle == obstacle; });
  if (at == end) {
    if (memory.turn_count < memory.turns.size())
      ++memory.turn_count;
    else
      at = std::min_element(begin, end,
                            [](const HeldTurn& a, const HeldTurn& b) { return a.seen_s < b.seen_s; });
  }
  *at = HeldTurn{obstacle, t_s, triple(axis)};
}

}  // namespace hamel::planner
