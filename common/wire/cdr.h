#pragma once
/// Plain CDR (XCDR1) both ways, with the checks the wire promises.  Private to codec.cpp.
///
/// Writer and Reader have the same face, so one description of a message (layout.h) serves both directions,
/// and a message is refused on the way out by exactly the rules that would refuse it on the way in.
/// Primitives are aligned to their size, counted from behind the encapsulation header.  After the first
/// broken rule the rest is skipped: every loop is bounded by what was checked before.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "common/wire/codec.h"

namespace hamel::wire::cdr {

static_assert(std::endian::native == std::endian::little, "Writer copies memory as little endian");
inline constexpr std::size_t kHeader = 4;  ///< 0, 0 or 1 (endianness), then two option bytes

/// Which non-finite numbers a field may hold.
enum class Real : std::uint8_t { finite, or_plus_inf };

/// The rules shared by both directions; the first one broken is kept.
class Checks {
 public:
  bool ok() const { return error_.rule[0] == '\0'; }
  DecodeError error() const { return error_; }
  void check(bool holds, const char* field, const char* rule) {
    if (!holds && ok()) error_ = {field, rule};
  }

 protected:
  void check_real(const char* field, double v, Real kind) {
    if (kind == Real::finite) check(std::isfinite(v), field, "must be finite");
    if (kind == Real::or_plus_inf) check(v > -kInf, field, "must be finite or +inf");  // false for NaN too
  }

 private:
  DecodeError error_;
};

class Writer : public Checks {
 public:
  /// Overwrites `out`; its capacity is reused.
  explicit Writer(bus::Payload& out) : out_(out) {
    out_.resize(std::max(out_.capacity(), kHeader));
    std::memset(out_.data(), 0, kHeader);
    out_[1] = std::byte{1};
  }

  template <class U>
  requires std::unsigned_integral<U> &&(!std::same_as<U, bool>)void integer(const char*, U v) {
    put(&v, sizeof v, sizeof v);
  }
  void boolean(const char*, bool v) {
    const std::uint8_t byte = v ? 1 : 0;
    put(&byte, 1, 1);
  }
  template <class E>
  void enumeration(const char* field, E v, E last) {
    const auto u = static_cast<std::uint32_t>(v);
    check(u <= static_cast<std::uint32_t>(last), field, "must be a known enum value");
    integer(field, u);
  }
  void real(const char* field, double v, Real kind = Real::finite) {
    check_real(field, v, kind);
    put(&v, sizeof v, sizeof v);
  }
  template <class Vector>
  void reals(const char* field, const Vector& v, Real kind = Real::finite) {
    for (Eigen::Index i = 0; i < v.size(); ++i) real(field, v[i], kind);
  }
  void text(const char* field, const std::string& s, std::size_t bound) {
    check(s.size() <= bound, field, "must not be longer than its bound");
    check(s.find('\0') == std::string::npos, field, "must not hold a zero byte");
    if (!ok()) return;
    integer(field, static_cast<std::uint32_t>(s.size() + 1));
    put(s.c_str(), s.size() + 1, 1);
  }
  void count(const char* field, std::size_t n, std::size_t bound) {
    check(n <= bound, field, "must not be longer than its bound");
    integer(field, static_cast<std::uint32_t>(ok() ? n : 0));
  }
  template <class T, class Each>
  void list(const char* field, const std::vector<T>& v, std::size_t bound, std::size_t, Each&& each) {
    count(field, v.size(), bound);
    for (std::size_t i = 0; ok() && i < v.size(); ++i) each(*this, v[i]);
  }
  template <class T, std::size_t N, class Each>
  void list(const char* field, const std::array<T, N>& v, const std::size_t& n, std::size_t, Each&& each) {
    count(field, n, N);
    for (std::size_t i = 0; ok() && i < n; ++i) each(*this, v[i]);
  }
  void joints(const char* field, const JointVector& v, Real kind = Real::finite) {
    count(field, static_cast<std::size_t>(v.size()), kMaxJoints);
    reals(field, v, kind);
  }

  /// Pads to a multiple of four, as RTPS would, and says so in the header's last two bits.  False if any rule
  /// was broken; `out` is then empty.
  bool finish(std::size_t max_bytes) {
    const std::size_t padding = (kHeader - size_ % kHeader) % kHeader;
    put(nullptr, 0, kHeader);
    check(size_ <= max_bytes, "payload", "must not be larger than its topic allows");
    out_[3] = static_cast<std::byte>(padding);
    out_.resize(ok() ? size_ : 0);
    return ok();
  }

 private:
  void put(const void* data, std::size_t n, std::size_t alignment) {
    const std::size_t at = (size_ - kHeader + alignment - 1) / alignment * alignment + kHeader;
    if (at + n > out_.size()) out_.resize(2 * (at + n));
    std::memset(out_.data() + size_, 0, at - size_);
    if (n > 0) std::memcpy(out_.data() + at, data, n);
    size_ = at + n;
  }

  bus::Payload& out_;
  std::size_t size_ = kHeader;
};

class Reader : public Checks {
 public:
  explicit Reader(std::span<const std::byte> payload) {
    check(payload.size() >= kHeader, "payload", "must hold an encapsulation header");
    if (!ok()) return;
    const auto kind = std::to_integer<unsigned>(payload[1]);
    check(payload[0] == std::byte{0} && kind <= 1, "encapsulation", "must be plain CDR (0 or 1)");
    swap_ = kind == 0;
    body_ = payload.subspan(kHeader);
  }

  template <class U>
  requires std::unsigned_integral<U> &&(!std::same_as<U, bool>)void integer(const char* field, U& v) {
    v = get<U>(field);
  }
  void boolean(const char* field, bool& v) {
    const auto byte = get<std::uint8_t>(field);
    check(byte <= 1, field, "must be 0 or 1");
    v = byte == 1;
  }
  template <class E>
  void enumeration(const char* field, E& v, E last) {
    const auto u = get<std::uint32_t>(field);
    check(u <= static_cast<std::uint32_t>(last), field, "must be a known enum value");
    v = ok() ? static_cast<E>(u) : E{};
  }
  void real(const char* field, double& v, Real kind = Real::finite) {
    v = std::bit_cast<double>(get<std::uint64_t>(field));
    check_real(field, v, kind);
  }
  template <class Vector>
  void reals(const char* field, Vector& v, Real kind = Real::finite) {
    for (Eigen::Index i = 0; i < v.size(); ++i) real(field, v[i], kind);
  }
  void text(const char* field, std::string& s, std::size_t bound) {
    const std::size_t n = count(field, bound + 1, 1);
    check(n >= 1, field, "must end with a zero byte");
    if (!ok()) return;
    const auto* chars = reinterpret_cast<const char*>(body_.data() + at_);
    check(std::memchr(chars, 0, n) == chars + n - 1, field, "must end with its only zero byte");
    if (ok()) s.assign(chars, n - 1);
    at_ += n;
  }
  /// The length of a sequence: within its bound, and its smallest items fit into what is left.
  std::size_t count(const char* field, std::size_t bound, std::size_t item_bytes) {
    const std::size_t n = get<std::uint32_t>(field);
    check(n <= bound, field, "must not be longer than its bound");
    check(n * item_bytes <= body_.size() - at_, field, "must not be longer than the payload");
    return ok() ? n : 0;
  }
  template <class T, class Each>
  void list(const char* field, std::vector<T>& v, std::size_t bound, std::size_t item_bytes, Each&& each) {
    v.resize(count(field, bound, item_bytes));
    for (std::size_t i = 0; ok() && i < v.size(); ++i) each(*this, v[i]);
  }
  template <class T, std::size_t N, class Each>
  void list(const char* field, std::array<T, N>& v, std::size_t& n, std::size_t item_bytes, Each&& each) {
    n = count(field, N, item_bytes);
    for (std::size_t i = 0; ok() && i < n; ++i) each(*this, v[i]);
  }
  void joints(const char* field, JointVector& v, Real kind = Real::finite) {
    v.resize(static_cast<Eigen::Index>(count(field, kMaxJoints, sizeof(double))));
    reals(field, v, kind);
  }

  /// Nothing may follow but the padding to a multiple of four that RTPS adds.
  void finish() { check(!ok() || body_.size() - at_ < kHeader, "payload", "must end behind its last field"); }

 private:
  template <class U>
  U get(const char* field) {
    const std::size_t at = (at_ + sizeof(U) - 1) / sizeof(U) * sizeof(U);
    check(at <= body_.size() && sizeof(U) <= body_.size() - at, field,
          "must be there: the payload is too short");
    if (!ok()) return U{};
    std::array<std::byte, sizeof(U)> bytes;
    std::memcpy(bytes.data(), body_.data() + at, sizeof(U));
    if (swap_) std::reverse(bytes.begin(), bytes.end());
    at_ = at + sizeof(U);
    return std::bit_cast<U>(bytes);
  }

  std::span<const std::byte> body_;
  std::size_t at_ = 0;  ///< never beyond the body's end
  bool swap_ = false;
};

}  // namespace hamel::wire::cdr
