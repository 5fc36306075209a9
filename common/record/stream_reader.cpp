#include <algorithm>
#include <utility>

#include "common/record/reader.h"

namespace hamel::record {
namespace {

bool is_magic(View b) {
  return b.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), b.begin(),
                                                 [](auto m, std::byte x) { return std::byte{m} == x; });
}

/// True where a chunk of known compression begins whose lengths agree with each other and fit into `left`
/// bytes. `head` holds what can be had of its beginning.
bool is_chunk(View head, std::uint64_t left) {
  Cursor in(head);
  const auto op = in.get<Op>();
  const auto length = in.get<std::uint64_t>();
  const auto begin = in.get<std::uint64_t>(), end = in.get<std::uint64_t>();
  const auto size = in.get<std::uint64_t>();
  in.get<std::uint32_t>();
  const std::string compression = in.text();
  const auto records = in.get<std::uint64_t>();
  return in.ok() && op == Op::chunk && begin <= end && size <= kMaxRecord && records <= kMaxRecord &&
         (compression.empty() || compression == "lz4" || compression == "zstd") &&
         length == kChunkHead + compression.size() + records && length <= left - kFrame;
}

constexpr std::uint64_t kChunkHeadMost = kFrame + kChunkHead + 4;

}  // namespace

Result<StreamReader, Problem> StreamReader::open(const std::string& path) {
  auto file = File::open(path);
  if (!file) return file.error();
  StreamReader r(std::move(file).value());
  Bytes magic;
  const bool begins = r.file_->read(0, kMagic.size(), magic) && is_magic(magic);
  if (begins) {
    r.at_ = kMagic.size();
    r.crc_ = crc32(magic);
    return r;
  }
  if (!r.find_chunk(0)) return Problem{path, "is no MCAP file"};
  // where only the magic is broken its header follows all the same, and attachments before the first chunk
  Bytes head;
  if (r.file_->read(kMagic.size(), kFrame, head)) {
    Cursor in(head);
    if (in.get<Op>() == Op::header && in.get<std::uint64_t>() <= r.at_) r.at_ = kMagic.size();
  }
  r.whole_ = false;
  r.waiting_.push_back(Damage{0, "does not begin as an MCAP file"});
  return r;
}

std::optional<Item> StreamReader::next() {
  while (true) {
    if (!waiting_.empty()) {
      Item item = std::move(waiting_.front());
      waiting_.pop_front();
      if (const auto* c = std::get_if<Channel>(&item)) channels_.insert(c->id);
      return item;
    }
    if (chunk_at_ < chunk_.size()) {
      if (auto item = next_in_chunk()) return item;
    } else if (!ended_) {
      if (auto item = next_in_file()) return item;
    } else {
      return {};
    }
  }
}

/// Schemas, channels and messages; anything else in a chunk is passed over.
std::optional<Item> StreamReader::next_in_chunk() {
  Cursor in(View(chunk_).subspan(chunk_at_));
  const auto op = in.get<Op>();
  const View content = in.take(in.get<std::uint64_t>());
  if (!in.ok()) {
    chunk_at_ = chunk_.size();
    return Damage{chunk_offset_, "the chunk's last record is longer than the chunk"};
  }
  chunk_at_ = chunk_.size() - in.rest().size();
  if (op != Op::schema && op != Op::channel && op != Op::message) return {};
  return use(op, chunk_offset_, content);
}

std::optional<Item> StreamReader::next_in_file() {
  const std::uint64_t at = at_;
  Bytes& head = record_;
  if (!file_->read(at, kFrame, head)) {
    ended_ = true;
    whole_ = false;
    return Damage{at, "the file ends without its footer: cut, or never closed"};
  }
  Cursor in(head);
  const auto op = in.get<Op>();
  const auto length = in.get<std::uint64_t>();
  if (op == Op{0}) return lost(at, "no record begins here");
  if (length > file_->size() - at - kFrame)
    return lost(at, "the file ends within a record: cut, or a length is wrong");
  if (length > kMaxRecord) return lost(at, "a record is too large");
  if (!file_->read(at, kFrame + length, record_)) return lost(at, "cannot be read");
  if (op == Op::chunk && !is_chunk(record_, file_->size() - at))
    return lost(at, "a chunk's lengths do not agree");
  at_ = at + kFrame + length;
  const std::uint32_t before = crc_;
  crc_ = crc32(record_, crc_);
  const View content = View(record_).subspan(kFrame);
  if (op == Op::data_end) {
    crc_ = before;
    return end_data(at, content);
  }
  if (op == Op::footer) return end_file(at, content);
  // A file has its messages in chunks or, without any, outside: here one is a changed message index.
  if (op == Op::message && chunk_offset_ > 0) return lost(at, "a message outside the chunks");
  return use(op, at, content);
}

std::optional<Item> StreamReader::use(Op op, std::uint64_t at, View content) {
  const auto broken = [&](const char* what) -> std::optional<Item> {
    whole_ = false;
    return Damage{at, what};
  };
  switch (op) {
    case Op::schema: {
      Schema s;
      return parse(content, s) ? std::optional<Item>(std::move(s)) : broken("a schema is broken");
    }
    case Op::channel: {
      Channel c;
      return parse(content, c) ? admit(std::move(c)) : broken("a channel is broken");
    }
    case Op::message: {
      Message m;
      return parse(content, m) ? admit(at, m) : broken("a message is broken");
    }
    case Op::chunk:
      return enter_chunk(at, content);
    case Op::metadata: {
      Metadata m;
      return parse(content, m) ? std::optional<Item>(std::move(m)) : broken("metadata are broken");
    }
    case Op::attachment: {
      Attachment a;
      std::uint32_t crc = 0, computed = 0;
      if (!parse(content, a, crc, computed)) return broken("an attachment is broken");
      if (crc != 0 && crc != computed) return broken("an attachment's CRC is wrong");
      return a;
    }
    default:
      return {};
  }
}

std::optional<Item> StreamReader::admit(Channel c) {
  channels_.insert(c.id);
  return c;
}

std::optional<Item> StreamReader::admit(std::uint64_t at, const Message& m) {
  if (channels_.contains(m.channel)) return m;
  if (!strangers_.insert(m.channel).second) return {};
  return Damage{at, "messages of channel " + std::to_string(m.channel) + ", which nothing describes"};
}

std::optional<Item> StreamReader::enter_chunk(std::uint64_t at, View content) {
  Chunk c;
  parse(content, c);
  chunk_offset_ = at;
  chunk_at_ = 0;
  sure_ = at_;
  std::string what = decompress(c.compression, c.records, c.uncompressed_size, chunk_);
  if (what.empty() && c.crc != 0 && crc32(chunk_) != c.crc) what = "CRC is wrong";
  if (what.empty()) return {};
  return lost(at, "a chunk cannot be used: " + what);
}

/// Reports what cannot be used at `at` and, where the framing is lost, finds the next chunk behind the last
/// one: a wrong length may have led past some.  Schemas and channels that stood there are taken from the
/// summary, if it is whole.
Item StreamReader::lost(std::uint64_t at, std::string what) {
  chunk_.clear();
  chunk_at_ = 0;
  whole_ = false;
  if (at_ <= at) ended_ = !find_chunk(sure_);
  if (!ended_ && !std::exchange(described_, true)) {
    if (const auto index = IndexedReader::open(file_->path())) {
      for (const auto& [id, schema] : index.value().summary().schemas) waiting_.push_back(schema);
      for (const auto& [id, channel] : index.value().summary().channels) waiting_.push_back(channel);
    }
  }
  return Damage{at, std::move(what)};
}

bool StreamReader::find_chunk(std::uint64_t from) {
  constexpr std::uint64_t kBlock = 1 << 20;
  Bytes block;
  for (; from < file_->size(); from += kBlock) {
    const std::uint64_t n = std::min(kBlock + kChunkHeadMost, file_->size() - from);
    if (!file_->read(from, n, block)) return false;
    for (std::size_t i = 0; i < block.size() && i < kBlock; ++i) {
      if (block[i] != static_cast<std::byte>(Op::chunk)) continue;
      const View head = View(block).subspan(i);
      if (!is_chunk(head.first(std::min<std::size_t>(head.size(), kChunkHeadMost)), file_->size() - from - i))
        continue;
      at_ = from + i;
      return true;
    }
  }
  return false;
}

std::optional<Item> StreamReader::end_data(std::uint64_t at, View content) {
  Cursor in(content);
  const auto crc = in.get<std::uint32_t>();
  if (!in.ok()) return lost(at, "the end of the data is broken");
  if (!whole_ || crc == 0 || crc == crc_) return {};
  whole_ = false;
  return Damage{at, "the data's CRC is wrong: something outside the chunks was changed"};
}

std::optional<Item> StreamReader::end_file(std::uint64_t at, View content) {
  ended_ = true;
  Bytes magic;
  const bool ends =
      content.size() == kFooterBytes && file_->read(at_, kMagic.size(), magic) && is_magic(magic);
  if (!ends) {
    whole_ = false;
    return Damage{at, "the footer is broken"};
  }
  complete_ = true;
  if (const auto index = IndexedReader::open(file_->path()); !index && whole_)
    return Damage{at, index.error().what};
  return {};
}

}  // namespace hamel::record
