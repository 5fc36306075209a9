#pragma once
/// The records of an MCAP file (mcap.dev/spec), as plain structs, and their bytes both ways.
///
///   <magic> <header> <data: attachments, metadata, chunks, message indexes, data end>
///   <summary: schemas, channels, statistics, indexes> <summary offsets> <footer> <magic>
///
/// A record is an opcode, a length (8 bytes) and its content.  Unknown opcodes and fields behind the known
/// ones are passed over, as the specification asks.

#include <array>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "common/record/bytes.h"

namespace hamel::record {

enum class Op : std::uint8_t {
  header = 1,
  footer,
  schema,
  channel,
  message,
  chunk,
  message_index,
  chunk_index,
  attachment,
  attachment_index,
  statistics,
  metadata,
  metadata_index,
  summary_offset,
  data_end
};

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t kFrame = 9;         ///< opcode and length
inline constexpr std::size_t kFooterBytes = 20;  ///< content of a footer
inline constexpr std::size_t kChunkHead =
    8 + 8 + 8 + 4 + 4 + 8;                               ///< of a chunk, without the compression's name
inline constexpr std::uint64_t kMaxRecord = 1ull << 28;  ///< a larger record is refused, not allocated

struct Header {
  std::string profile, library;
};

struct Schema {
  std::uint16_t id = 0;
  std::string name, encoding, data;
};

struct Channel {
  std::uint16_t id = 0, schema = 0;
  std::string topic, encoding;
  Map metadata;
};

/// `data` points into the reader's buffer until its next record.
struct Message {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0, publish_time = 0;  ///< ns
  View data;
};

struct Attachment {
  std::uint64_t log_time = 0, create_time = 0;
  std::string name, media_type, data;
};

struct Metadata {
  std::string name;
  Map entries;
};

/// The head of a chunk; `records` points into the buffer it was read from.
struct Chunk {
  std::uint64_t begin = 0, end = 0, uncompressed_size = 0;
  std::uint32_t crc = 0;
  std::string compression;
  View records;
};

struct ChunkIndex {
  std::uint64_t begin = 0, end = 0, offset = 0, length = 0;
  std::vector<std::pair<std::uint16_t, std::uint64_t>> channels;  ///< and where their message index stands
  std::uint64_t index_length = 0;
  std::string compression;
  std::uint64_t compressed_size = 0, uncompressed_size = 0;
};

/// Where an attachment or a metadata record stands; times and sizes only for the former.
struct Place {
  std::uint64_t offset = 0, length = 0, log_time = 0, create_time = 0, data_size = 0;
  std::string name, media_type;
};

struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0, attachments = 0, metadata = 0, chunks = 0;
  std::uint64_t begin = 0, end = 0;
  std::vector<std::pair<std::uint16_t, std::uint64_t>> by_channel;
};

// Appends one whole record.
void append(Bytes& out, const Header& r);
void append(Bytes& out, const Schema& r);
void append(Bytes& out, const Channel& r);
void append(Bytes& out, const Message& r);
void append(Bytes& out, const Attachment& r);
void append(Bytes& out, const Metadata& r);
void append(Bytes& out, const Chunk& r);
void append(Bytes& out, const ChunkIndex& r);
void append(Bytes& out, const Statistics& r);
void append_place(Bytes& out, Op op, const Place& r);
/// A record of any content: opcode, length, then what `fill` appends.
template <class Fill>
void append_record(Bytes& out, Op op, Fill&& fill) {
  Out o(out);
  o.put(op);
  const std::size_t at = o.size();
  o.put(std::uint64_t{0});
  fill(o);
  o.patch(at, static_cast<std::uint64_t>(o.size() - at - 8));
}

// Reads a record's content; false when it is too short for its fields.
bool parse(View content, Header& r);
bool parse(View content, Schema& r);
bool parse(View content, Channel& r);
bool parse(View content, Message& r);
bool parse(View content, Attachment& r, std::uint32_t& crc, std::uint32_t& computed);
bool parse(View content, Metadata& r);
bool parse(View content, Chunk& r);
bool parse(View content, ChunkIndex& r);
bool parse(View content, Statistics& r);
bool parse_place(View content, Op op, Place& r);

enum class Compression : std::uint8_t { none, lz4, zstd };
/// As the format writes it: "", "lz4", "zstd".
const char* name_in_file(Compression c);
/// "none", "lz4" or "zstd"; the error lists the names.
Result<Compression, Problem> compression_from(std::string_view name);

/// Replaces `out` by `in` compressed; false when the library refuses (out of memory).
bool compress(Compression c, View in, Bytes& out);
/// Replaces `out` by exactly `size` bytes; the sentence of what is wrong, else empty.  Never allocates more.
std::string decompress(std::string_view compression, View in, std::uint64_t size, Bytes& out);

}  // namespace hamel::record
