#pragma once
/// Random numbers that are the same on every machine.

#include <cstdint>

namespace hamel {

/// splitmix64 [Steele 2014]: a stream of 64-bit numbers, each a mix of a counter, for any seed.
class SplitMix64 {
 public:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ull;  ///< of the counter
  constexpr explicit SplitMix64(std::uint64_t seed) noexcept : counter_(seed) {}
  constexpr std::uint64_t next() noexcept {
    std::uint64_t z = (counter_ += kStep);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  /// In [0, 1), a multiple of 2^-53.
  constexpr double unit() noexcept { return static_cast<double>(next() >> 11) * 0x1p-53; }
  constexpr double uniform(double low, double high) noexcept { return low + (high - low) * unit(); }

 private:
  std::uint64_t counter_;
};

}  // namespace hamel
