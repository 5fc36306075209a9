/// The compressions of chunks: none, LZ4 frames, Zstandard.

#include <lz4frame.h>
#include <zstd.h>

#include "common/record/format.h"

namespace hamel::record {
namespace {

constexpr int kZstdLevel = 1;  // the fastest: a recorder shares its processor with the arm

std::string decompress_lz4(View in, Bytes& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return "lz4: out of memory";
  std::size_t at = 0, left = 1;
  std::string problem;
  while (problem.empty() && !in.empty() && left != 0) {
    std::size_t written = out.size() - at, read = in.size();
    left = LZ4F_decompress(context, out.data() + at, &written, in.data(), &read, nullptr);
    if (LZ4F_isError(left)) problem = std::string("lz4: ") + LZ4F_getErrorName(left);
    if (read == 0 && written == 0 && left != 0) break;  // the output is full before the frame is over
    at += written;
    in = in.subspan(read);
  }
  LZ4F_freeDecompressionContext(context);
  if (problem.empty() && (left != 0 || at != out.size())) problem = "lz4: not of the length that it states";
  return problem;
}

}  // namespace

const char* name_in_file(Compression c) {
  switch (c) {
    case Compression::none:
      return "";
    case Compression::lz4:
      return "lz4";
    case Compression::zstd:
      return "zstd";
  }
  return "";
}

Result<Compression, Problem> compression_from(std::string_view name) {
  if (name == "none") return Compression::none;
  if (name == "lz4") return Compression::lz4;
  if (name == "zstd") return Compression::zstd;
  return Problem{"compression", "= " + std::string(name) + ", must be none, lz4 or zstd"};
}

bool compress(Compression c, View in, Bytes& out) {
  if (c == Compression::none) {
    out.assign(in.begin(), in.end());
    return true;
  }
  const bool lz4 = c == Compression::lz4;
  out.resize(lz4 ? LZ4F_compressFrameBound(in.size(), nullptr) : ZSTD_compressBound(in.size()));
  const std::size_t n = lz4 ? LZ4F_compressFrame(out.data(), out.size(), in.data(), in.size(), nullptr)
                            : ZSTD_compress(out.data(), out.size(), in.data(), in.size(), kZstdLevel);
  if (lz4 ? LZ4F_isError(n) != 0 : ZSTD_isError(n) != 0) return false;
  out.resize(n);
  return true;
}

std::string decompress(std::string_view compression, View in, std::uint64_t size, Bytes& out) {
  out.clear();
  if (size > kMaxRecord) return "states a length of " + std::to_string(size) + " bytes, too large";
  if (compression.empty()) {
    if (in.size() != size) return "is not of the length that it states";
    out.assign(in.begin(), in.end());
    return {};
  }
  out.resize(static_cast<std::size_t>(size));
  if (compression == "lz4") return decompress_lz4(in, out);
  if (compression != "zstd") return "has the unknown compression \"" + std::string(compression) + "\"";
  const std::size_t n = ZSTD_decompress(out.data(), out.size(), in.data(), in.size());
  if (ZSTD_isError(n)) return std::string("zstd: ") + ZSTD_getErrorName(n);
  return n == size ? "" : "zstd: not of the length that it states";
}

}  // namespace hamel::record
