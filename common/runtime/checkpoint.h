#pragma once
/// A memory-mapped slot that outlives its process: written each step, read once at start.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace hamel::runtime {

/// Two alternating slots in one file.  A killed process (-9) loses nothing written; after a power cut the
/// last synced slot is found, at most a second old where sync() is called each second.  Each slot carries a
/// sequence number, its size and an XXH3 of both; the newest slot that is whole wins.  One writer a file
/// (locked).
class Checkpoint {
 public:
  /// Opens or makes `path` for payloads up to `capacity` bytes of the format `kind` (foreign formats are
  /// refused).
  static Result<std::unique_ptr<Checkpoint>, Problem> open(const std::string& path, std::uint32_t kind,
                                                           std::size_t capacity);
  ~Checkpoint();
  Checkpoint(const Checkpoint&) = delete;
  Checkpoint& operator=(const Checkpoint&) = delete;

  /// DIR/SERVICE-ARM.checkpoint, opened, and its newest whole payload given to `restore`, which refuses what
  /// is of another scene or version.  What was passed over or refused is logged with the reason.
  static Result<std::unique_ptr<Checkpoint>, Problem> resume(
      const std::string& dir, const std::string& service, std::uint32_t arm, std::uint32_t kind,
      std::size_t capacity, const std::function<bool(std::span<const std::byte>)>& restore);

  /// The newest whole payload; empty when there is none.  `note` says what was passed over and why, else
  /// empty.
  std::vector<std::byte> load(std::string& note) const;
  /// Replaces the older slot.  False when the payload is larger than the capacity.  No allocation, no system
  /// call.
  bool save(std::span<const std::byte> payload) noexcept;
  /// Pushes what was saved towards the disk without waiting.
  void sync() noexcept;

 private:
  struct Slot;
  Checkpoint() = default;
  Slot* slot(int i) const noexcept;
  int fd_ = -1;
  std::byte* map_ = nullptr;
  std::size_t length_ = 0, capacity_ = 0;
  std::uint32_t kind_ = 0;
  std::uint64_t sequence_ = 0;
};

/// Appends plain values to a byte vector, and reads them back with a check for the end.
class Packer {
 public:
  explicit Packer(std::vector<std::byte>& out) : out_(out) { out_.clear(); }
  template <class T>
  void put(const T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto* b = reinterpret_cast<const std::byte*>(&v);
    out_.insert(out_.end(), b, b + sizeof(T));
  }
  void put(const double* v, std::size_t n) {
    put(static_cast<std::uint64_t>(n));
    const auto* b = reinterpret_cast<const std::byte*>(v);
    out_.insert(out_.end(), b, b + n * sizeof(double));
  }

 private:
  std::vector<std::byte>& out_;
};

class Unpacker {
 public:
  explicit Unpacker(std::span<const std::byte> in) : in_(in) {}
  template <class T>
  bool get(T& v) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (in_.size() < sizeof(T)) return false;
    __builtin_memcpy(&v, in_.data(), sizeof(T));
    in_ = in_.subspan(sizeof(T));
    return true;
  }
  /// Reads doubles into anything with resize() and data(); false when fewer are left than promised.
  template <class V>
  bool get_doubles(V& v) {
    std::uint64_t n = 0;
    if (!get(n) || n > in_.size() / sizeof(double)) return false;
    v.resize(static_cast<decltype(v.size())>(n));
    if (n > 0) __builtin_memcpy(v.data(), in_.data(), n * sizeof(double));
    in_ = in_.subspan(n * sizeof(double));
    return true;
  }
  bool at_end() const { return in_.empty(); }

 private:
  std::span<const std::byte> in_;
};

}  // namespace hamel::runtime
