#include "common/record/format.h"

#include <zlib.h>

#include <limits>

namespace hamel::record {

std::uint32_t crc32(View bytes, std::uint32_t crc) noexcept {
  constexpr std::size_t kMost = std::numeric_limits<uInt>::max();
  while (!bytes.empty()) {
    const std::size_t n = std::min(bytes.size(), kMost);
    crc = static_cast<std::uint32_t>(
        ::crc32(crc, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(n)));
    bytes = bytes.subspan(n);
  }
  return crc;
}

namespace {

using Counts = std::vector<std::pair<std::uint16_t, std::uint64_t>>;

void put_counts(Out& o, const Counts& counts) {
  o.put(static_cast<std::uint32_t>(counts.size() * 10));
  for (const auto& [channel, value] : counts) o.put(channel), o.put(value);
}

Counts get_counts(Cursor& in) {
  Cursor inner(in.take(in.get<std::uint32_t>()));
  Counts out;
  while (inner.ok() && !inner.empty()) {
    const auto channel = inner.get<std::uint16_t>();
    const auto value = inner.get<std::uint64_t>();
    if (inner.ok()) out.emplace_back(channel, value);
  }
  return out;
}

std::string string_of(View v) { return {reinterpret_cast<const char*>(v.data()), v.size()}; }

}  // namespace

void append(Bytes& out, const Header& r) {
  append_record(out, Op::header, [&](Out& o) { o.text(r.profile), o.text(r.library); });
}

void append(Bytes& out, const Schema& r) {
  append_record(out, Op::schema,
                [&](Out& o) { o.put(r.id), o.text(r.name), o.text(r.encoding), o.text(r.data); });
}

void append(Bytes& out, const Channel& r) {
  append_record(out, Op::channel, [&](Out& o) {
    o.put(r.id), o.put(r.schema), o.text(r.topic), o.text(r.encoding), o.map(r.metadata);
  });
}

void append(Bytes& out, const Message& r) {
  append_record(out, Op::message, [&](Out& o) {
    o.put(r.channel), o.put(r.sequence), o.put(r.log_time), o.put(r.publish_time), o.raw(r.data);
  });
}

void append(Bytes& out, const Attachment& r) {
  append_record(out, Op::attachment, [&](Out& o) {
    const std::size_t begin = o.size();
    o.put(r.log_time), o.put(r.create_time), o.text(r.name), o.text(r.media_type);
    o.put(static_cast<std::uint64_t>(r.data.size()));
    o.raw(std::as_bytes(std::span(r.data)));
    o.put(crc32(View(out).subspan(begin)));
  });
}

void append(Bytes& out, const Metadata& r) {
  append_record(out, Op::metadata, [&](Out& o) { o.text(r.name), o.map(r.entries); });
}

void append(Bytes& out, const Chunk& r) {
  append_record(out, Op::chunk, [&](Out& o) {
    o.put(r.begin), o.put(r.end), o.put(r.uncompressed_size), o.put(r.crc), o.text(r.compression);
    o.put(static_cast<std::uint64_t>(r.records.size()));
    o.raw(r.records);
  });
}

void append(Bytes& out, const ChunkIndex& r) {
  append_record(out, Op::chunk_index, [&](Out& o) {
    o.put(r.begin), o.put(r.end), o.put(r.offset), o.put(r.length);
    put_counts(o, r.channels);
    o.put(r.index_length), o.text(r.compression), o.put(r.compressed_size), o.put(r.uncompressed_size);
  });
}

void append(Bytes& out, const Statistics& r) {
  append_record(out, Op::statistics, [&](Out& o) {
    o.put(r.messages), o.put(r.schemas), o.put(r.channels), o.put(r.attachments), o.put(r.metadata);
    o.put(r.chunks), o.put(r.begin), o.put(r.end);
    put_counts(o, r.by_channel);
  });
}

void append_place(Bytes& out, Op op, const Place& r) {
  append_record(out, op, [&](Out& o) {
    o.put(r.offset), o.put(r.length);
    if (op == Op::attachment_index) o.put(r.log_time), o.put(r.create_time), o.put(r.data_size);
    o.text(r.name);
    if (op == Op::attachment_index) o.text(r.media_type);
  });
}

bool parse(View content, Header& r) {
  Cursor in(content);
  r.profile = in.text(), r.library = in.text();
  return in.ok();
}

bool parse(View content, Schema& r) {
  Cursor in(content);
  r.id = in.get<std::uint16_t>(), r.name = in.text(), r.encoding = in.text(), r.data = in.text();
  return in.ok();
}

bool parse(View content, Channel& r) {
  Cursor in(content);
  r.id = in.get<std::uint16_t>(), r.schema = in.get<std::uint16_t>();
  r.topic = in.text(), r.encoding = in.text(), r.metadata = in.map();
  return in.ok();
}

bool parse(View content, Message& r) {
  Cursor in(content);
  r.channel = in.get<std::uint16_t>(), r.sequence = in.get<std::uint32_t>();
  r.log_time = in.get<std::uint64_t>(), r.publish_time = in.get<std::uint64_t>();
  r.data = in.rest();
  return in.ok();
}

bool parse(View content, Attachment& r, std::uint32_t& crc, std::uint32_t& computed) {
  Cursor in(content);
  r.log_time = in.get<std::uint64_t>(), r.create_time = in.get<std::uint64_t>();
  r.name = in.text(), r.media_type = in.text();
  r.data = string_of(in.take(in.get<std::uint64_t>()));
  computed = crc32(content.first(content.size() - in.rest().size()));
  crc = in.get<std::uint32_t>();
  return in.ok();
}

bool parse(View content, Metadata& r) {
  Cursor in(content);
  r.name = in.text(), r.entries = in.map();
  return in.ok();
}

bool parse(View content, Chunk& r) {
  Cursor in(content);
  r.begin = in.get<std::uint64_t>(), r.end = in.get<std::uint64_t>();
  r.uncompressed_size = in.get<std::uint64_t>(), r.crc = in.get<std::uint32_t>();
  r.compression = in.text();
  r.records = in.take(in.get<std::uint64_t>());
  return in.ok();
}

bool parse(View content, ChunkIndex& r) {
  Cursor in(content);
  r.begin = in.get<std::uint64_t>(), r.end = in.get<std::uint64_t>();
  r.offset = in.get<std::uint64_t>(), r.length = in.get<std::uint64_t>();
  r.channels = get_counts(in);
  r.index_length = in.get<std::uint64_t>(), r.compression = in.text();
  r.compressed_size = in.get<std::uint64_t>(), r.uncompressed_size = in.get<std::uint64_t>();
  return in.ok();
}

bool parse(View content, Statistics& r) {
  Cursor in(content);
  r.messages = in.get<std::uint64_t>(), r.schemas = in.get<std::uint16_t>();
  r.channels = in.get<std::uint32_t>(), r.attachments = in.get<std::uint32_t>();
  r.metadata = in.get<std::uint32_t>(), r.chunks = in.get<std::uint32_t>();
  r.begin = in.get<std::uint64_t>(), r.end = in.get<std::uint64_t>();
  r.by_channel = get_counts(in);
  return in.ok();
}

bool parse_place(View content, Op op, Place& r) {
  Cursor in(content);
  r.offset = in.get<std::uint64_t>(), r.length = in.get<std::uint64_t>();
  if (op == Op::attachment_index) {
    r.log_time = in.get<std::uint64_t>(), r.create_time = in.get<std::uint64_t>();
    r.data_size = in.get<std::uint64_t>();
  }
  r.name = in.text();
  if (op == Op::attachment_index) r.media_type = in.text();
  return in.ok();
}

}  // namespace hamel::record
