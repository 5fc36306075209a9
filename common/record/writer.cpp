#include "common/record/writer.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace hamel::record {

Result<std::unique_ptr<Writer>, Problem> Writer::create(const std::string& path,
                                                        const WriterOptions& options) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) return Problem{path, std::string("cannot write: ") + std::strerror(errno)};
  std::unique_ptr<Writer> w(new Writer(path, fd, options));
  Bytes head;
  Out(head).raw(std::as_bytes(std::span(kMagic)));
  append(head, Header{"", options.library});
  if (!w->put(head)) return *w->problem_;
  return w;
}

Writer::Writer(std::string path, int fd, const WriterOptions& options)
    : path_(std::move(path)), options_(options), fd_(fd) {}

Writer::~Writer() {
  close();
  ::close(fd_);
}

/// Whole records, all or nothing: what was written in part is cut off again.
bool Writer::put(View bytes) {
  View left = bytes;
  while (!left.empty()) {
    const ssize_t n = ::write(fd_, left.data(), left.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      if (!problem_) problem_ = Problem{path_, std::string("cannot write on: ") + std::strerror(errno)};
      (void)!::ftruncate(fd_, static_cast<off_t>(offset_));
      ::lseek(fd_, static_cast<off_t>(offset_), SEEK_SET);
      return false;
    }
    left = left.subspan(static_cast<std::size_t>(n));
  }
  offset_ += bytes.size();
  crc_ = crc32(bytes, crc_);
  return true;
}

std::uint16_t Writer::add(Schema schema) {
  schema.id = static_cast<std::uint16_t>(schemas_.size() + 1);
  schemas_.push_back(std::move(schema));
  return schemas_.back().id;
}

std::uint16_t Writer::add(Channel channel) {
  channel.id = static_cast<std::uint16_t>(channels_.size() + 1);
  channels_.push_back(std::move(channel));
  return channels_.back().id;
}

bool Writer::write(const Message& message, Time now) {
  if (problem_ || closed_) {
    ++refused_;
    return false;
  }
  enter(message, now);
  if (chunk_.size() >= options_.chunk_bytes) return flush();
  return tick(now);
}

/// Puts a message into the open chunk; new schemas and channels stand before the first message.
void Writer::enter(const Message& message, Time now) {
  for (; schemas_out_ < schemas_.size(); ++schemas_out_) append(chunk_, schemas_[schemas_out_]);
  for (; channels_out_ < channels_.size(); ++channels_out_) append(chunk_, channels_[channels_out_]);
  if (in_chunk_++ == 0) begin_ = end_ = message.log_time;
  begin_ = std::min(begin_, message.log_time);
  end_ = std::max(end_, message.log_time);
  if (!opened_) opened_ = now;
  entries_[message.channel].emplace_back(message.log_time, chunk_.size());
  append(chunk_, message);
}

bool Writer::tick(Time now) {
  if (!opened_ || now - *opened_ < options_.flush_every) return !problem_;
  return flush();
}

bool Writer::flush() {
  if (problem_ || in_chunk_ == 0) return !problem_;
  const bool whole = put_chunk();
  if (whole)
    count_chunk();
  else
    refused_ += in_chunk_;
  for (auto& [channel, entries] : entries_) entries.clear();
  chunk_.clear();
  in_chunk_ = 0;
  opened_.reset();
  return whole;
}

bool Writer::put_chunk() {
  if (!compress(options_.compression, chunk_, packed_)) {
    problem_ = Problem{path_, "cannot compress: out of memory"};
    return false;
  }
  record_.clear();
  append(record_,
         Chunk{begin_, end_, chunk_.size(), crc32(chunk_), name_in_file(options_.compression), packed_});
  for (auto& [channel, entries] : entries_) {
    if (entries.empty()) continue;
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.first < b.first; });
    append_record(record_, Op::message_index, [&](Out& o) {
      o.put(channel), o.put(static_cast<std::uint32_t>(entries.size() * 16));
      for (const auto& [time, at] : entries) o.put(time), o.put(at);
    });
  }
  return put(record_);
}

void Writer::count_chunk() {
  if (statistics_.messages == 0) statistics_.begin = begin_, statistics_.end = end_;
  statistics_.begin = std::min(statistics_.begin, begin_);
  statistics_.end = std::max(statistics_.end, end_);
  statistics_.messages += in_chunk_;
  ++statistics_.chunks;
  for (const auto& [channel, entries] : entries_) counts_[channel] += entries.size();
}

bool Writer::write(const Attachment& a) {
  if (problem_ || closed_ || !flush()) return false;
  record_.clear();
  append(record_, a);
  const Place place{offset_, record_.size(), a.log_time, a.create_time, a.data.size(), a.name, a.media_type};
  if (!put(record_)) return false;
  attachments_.push_back(place);
  return true;
}

bool Writer::write(const Metadata& m) {
  if (problem_ || closed_ || !flush()) return false;
  record_.clear();
  append(record_, m);
  const Place place{offset_, record_.size(), 0, 0, 0, m.name, ""};
  if (!put(record_)) return false;
  metadata_.push_back(place);
  return true;
}

bool Writer::close() {
  if (closed_) return !problem_;
  flush();
  closed_ = true;
  put_summary();
  return !problem_;
}

/// One kind of record, and where it stands.
template <class Fill>
void Writer::put_group(Op op, Bytes& offsets, Fill&& fill) {
  const std::uint64_t at = offset_;
  record_.clear();
  fill();
  put(record_);
  if (offset_ == at) return;
  append_record(offsets, Op::summary_offset, [&](Out& o) { o.put(op), o.put(at), o.put(offset_ - at); });
}

/// The index of every chunk before `end`, from the heads of the records in the file.
void Writer::put_indexes(std::uint64_t end) {
  constexpr std::size_t kHead = kFrame + kChunkHead + 4;
  constexpr std::size_t kBlock = 1 << 16;
  std::optional<ChunkIndex> chunk;
  const auto finish = [&] {
    if (chunk) append(record_, *chunk);
    chunk.reset();
    if (record_.size() < kBlock) return;
    put(record_);
    record_.clear();
  };
  std::array<std::byte, kHead> head;
  for (std::uint64_t at = kMagic.size(); at < end && !problem_;) {
    const ssize_t n = ::pread(fd_, head.data(), head.size(), static_cast<off_t>(at));
    if (n < static_cast<ssize_t>(kFrame)) break;
    Cursor in(View(head).first(static_cast<std::size_t>(n)));
    const auto op = in.get<Op>();
    const auto length = in.get<std::uint64_t>();
    if (op == Op::message_index && chunk) {
      chunk->channels.emplace_back(in.get<std::uint16_t>(), at);
      chunk->index_length += kFrame + length;
    } else {
      finish();
    }
    if (op == Op::chunk) {
      ChunkIndex& c = chunk.emplace();
      c.begin = in.get<std::uint64_t>(), c.end = in.get<std::uint64_t>();
      c.offset = at, c.length = kFrame + length;
      c.uncompressed_size = in.get<std::uint64_t>();
      in.get<std::uint32_t>();
      c.compression = in.text();
      c.compressed_size = in.get<std::uint64_t>();
    }
    at += kFrame + length;
  }
  finish();
}

/// Gives up everything from `end` on.
void Writer::cut(std::uint64_t end) {
  (void)!::ftruncate(fd_, static_cast<off_t>(end));
  ::lseek(fd_, static_cast<off_t>(end), SEEK_SET);
  offset_ = end;
}

void Writer::put_summary() {
  const std::uint64_t data_end = offset_;
  const bool sound = !problem_;
  const std::optional<Problem> before = std::exchange(problem_, std::nullopt);
  record_.clear();
  append_record(record_, Op::data_end, [&](Out& o) { o.put(crc_); });
  put(record_);
  const std::uint64_t start = offset_;
  crc_ = 0;
  // Those that no chunk holds are not in the data, so neither in the summary.
  schemas_.resize(schemas_out_);
  channels_.resize(channels_out_);
  statistics_.schemas = static_cast<std::uint16_t>(schemas_.size());
  statistics_.channels = static_cast<std::uint32_t>(channels_.size());
  statistics_.attachments = static_cast<std::uint32_t>(attachments_.size());
  statistics_.metadata = static_cast<std::uint32_t>(metadata_.size());
  statistics_.by_channel.assign(counts_.begin(), counts_.end());
  Bytes offsets;
  put_group(Op::schema, offsets, [&] {
    for (const Schema& s : schemas_) append(record_, s);
  });
  put_group(Op::channel, offsets, [&] {
    for (const Channel& c : channels_) append(record_, c);
  });
  put_group(Op::statistics, offsets, [&] { append(record_, statistics_); });
  put_group(Op::chunk_index, offsets, [&] { put_indexes(data_end); });
  put_group(Op::attachment_index, offsets, [&] {
    for (const Place& p : attachments_) append_place(record_, Op::attachment_index, p);
  });
  put_group(Op::metadata_index, offsets, [&] {
    for (const Place& p : metadata_) append_place(record_, Op::metadata_index, p);
  });
  const std::uint64_t offsets_start = offset_;
  put(offsets);
  record_.clear();
  Out o(record_);
  o.put(Op::footer), o.put(std::uint64_t{kFooterBytes}), o.put(start), o.put(offsets_start);
  o.put(crc32(record_, crc_));
  o.raw(std::as_bytes(std::span(kMagic)));
  put(record_);
  if (problem_) cut(data_end);
  if (!sound) problem_ = before;
}

}  // namespace hamel::record
