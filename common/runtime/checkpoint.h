#pragma once
/// A memory-mapped slot that outlives its process: written each step, read once at start.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/runtime/disk_copy.h"

namespace hamel::runtime {

/// Which start of the machine this is: another after each reboot.
using BootId = std::array<char, 36>;
/// Of this machine; zeros where the kernel does not tell.
BootId boot_id();

/// Two alternating slots in one file, and a copy beside it that survives a power cut.
///
/// A killed process (-9) loses nothing: the kernel keeps what was written to the map.  After a power cut
/// there may be no more than the copy (PATH.durable) that sync() asked for last.  Each slot carries a
/// sequence number, the boot that wrote it, its size and an XXH3 of all; one resumes from the newest of the
/// three that is whole. One writer a file (locked).
class Checkpoint {
 public:
  /// Takes a payload, and whether another boot of the machine wrote it: then what followed it is lost, and
  /// others may have seen it.  @return why it is refused; empty: resumed from
  using Restore = std::function<std::string(std::span<const std::byte> payload, bool rebooted)>;

  /// Opens or makes `path` for payloads up to `capacity` bytes of the format `kind`.  A file of another size
  /// is kept aside as PATH.refused-N.
  static Result<std::unique_ptr<Checkpoint>, Problem> open(const std::string& path, std::uint32_t kind,
                                                           std::size_t capacity,
                                                           const BootId& boot = boot_id());
  ~Checkpoint();
  Checkpoint(const Checkpoint&) = delete;
  Checkpoint& operator=(const Checkpoint&) = delete;

  /// DIR/SERVICE-ARM.checkpoint, opened and resumed from.
  static Result<std::unique_ptr<Checkpoint>, Problem> resume(const std::string& dir,
                                                             const std::string& service, std::uint32_t arm,
                                                             std::uint32_t kind, std::size_t capacity,
                                                             const BootId& boot, const Restore& restore);

  /// Offers what is whole to `restore`, newest first, until one is taken.  What is passed over or refused is
  /// logged with the reason; where a slot was of another version or refused, the file is kept aside as
  /// PATH.refused-N before it is written again.  @return whether one was taken
  bool load(const Restore& restore);
  /// Replaces the older slot.  False when the payload is larger than the capacity.  No allocation, no system
  /// call.
  bool save(std::span<const std::byte> payload) noexcept;
  /// Twice a second at most: has what was saved last copied to the disk, by a thread of its own.  Waits for
  /// nothing.
  void sync(std::chrono::steady_clock::time_point now) noexcept;

 private:
  struct Slot;
  struct Found;
  Checkpoint() = default;
  Slot* slot(int i) const noexcept;
  Problem failed(const char* what) const;
  std::string keep_aside() const;
  std::vector<Found> look(bool& strange) const;

  std::string path_;
  int fd_ = -1;
  std::byte* map_ = nullptr;
  std::size_t length_ = 0, capacity_ = 0;
  std::uint32_t kind_ = 0;
  std::uint64_t sequence_ = 0;
  BootId boot_{};
  std::chrono::steady_clock::time_point last_sync_{};
  std::unique_ptr<DiskCopy> durable_;
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
