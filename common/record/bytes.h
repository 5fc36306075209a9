#pragma once
/// Little-endian records of the MCAP format, one byte vector in, one cursor out.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace hamel::record {

static_assert(std::endian::native == std::endian::little, "records are copied as little endian");

using Bytes = std::vector<std::byte>;
using View = std::span<const std::byte>;
using Map = std::vector<std::pair<std::string, std::string>>;

/// CRC-32 (IEEE) of `bytes`, continued from `crc`; 0 begins.
std::uint32_t crc32(View bytes, std::uint32_t crc = 0) noexcept;

/// Appends to a byte vector.
class Out {
 public:
  explicit Out(Bytes& bytes) : bytes_(bytes) {}

  template <class T>
  void put(T v) {
    static_assert(std::is_integral_v<T> || std::is_enum_v<T>);
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    std::memcpy(bytes_.data() + at, &v, sizeof(T));
  }
  void raw(View v) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + v.size());
    if (!v.empty()) std::memcpy(bytes_.data() + at, v.data(), v.size());
  }
  void text(std::string_view s) {
    put(static_cast<std::uint32_t>(s.size()));
    raw(std::as_bytes(std::span(s)));
  }
  void map(const Map& m) {
    const std::size_t at = bytes_.size();
    put(std::uint32_t{0});
    for (const auto& [key, value] : m) text(key), text(value);
    patch(at, static_cast<std::uint32_t>(bytes_.size() - at - 4));
  }
  /// Overwrites what stands at `at`.
  template <class T>
  void patch(std::size_t at, T v) {
    std::memcpy(bytes_.data() + at, &v, sizeof v);
  }
  std::size_t size() const { return bytes_.size(); }

 private:
  Bytes& bytes_;
};

/// Reads from the front.  After the first thing that is not there everything is empty and ok() is false.
class Cursor {
 public:
  explicit Cursor(View in) : in_(in) {}

  template <class T>
  T get() {
    static_assert(std::is_trivially_copyable_v<T>);
    T v{};
    const View b = take(sizeof(T));
    if (ok_) std::memcpy(&v, b.data(), sizeof(T));
    return v;
  }
  View take(std::uint64_t n) {
    ok_ &= n <= in_.size();
    if (!ok_) return {};
    const View out = in_.first(static_cast<std::size_t>(n));
    in_ = in_.subspan(static_cast<std::size_t>(n));
    return out;
  }
  std::string text() {
    const View b = take(get<std::uint32_t>());
    return std::string(reinterpret_cast<const char*>(b.data()), b.size());
  }
  Map map() {
    Cursor inner(take(get<std::uint32_t>()));
    Map out;
    while (inner.ok() && !inner.empty()) {
      std::string key = inner.text();
      std::string value = inner.text();
      out.emplace_back(std::move(key), std::move(value));
    }
    ok_ &= inner.ok();
    return out;
  }
  View rest() const { return in_; }
  bool empty() const { return in_.empty(); }
  bool ok() const { return ok_; }

 private:
  View in_;
  bool ok_ = true;
};

}  // namespace hamel::record
