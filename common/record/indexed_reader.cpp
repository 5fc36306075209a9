#include <algorithm>
#include <cstring>
#include <tuple>

#include "common/record/reader.h"

namespace hamel::record {

Result<IndexedReader, Problem> IndexedReader::open(const std::string& path) {
  auto file = File::open(path);
  if (!file) return file.error();
  IndexedReader r(std::move(file).value());
  if (auto problem = r.load()) return *problem;
  r.seek({});
  return r;
}

std::optional<Problem> IndexedReader::load() {
  const auto fail = [this](const std::string& what) { return Problem{file_->path(), what}; };
  constexpr std::uint64_t kMostSummary = 1ull << 30;  // weeks of recording
  constexpr std::uint64_t kTail = kFrame + kFooterBytes + kMagic.size();
  Bytes head, tail, summary;
  if (!file_->read(0, kMagic.size() + kFrame, head) ||
      std::memcmp(head.data(), kMagic.data(), kMagic.size()) != 0)
    return fail("is no MCAP file");
  const bool ends = file_->size() >= kTail && file_->read(file_->size() - kTail, kTail, tail) &&
                    std::memcmp(tail.data() + kFrame + kFooterBytes, kMagic.data(), kMagic.size()) == 0;
  if (!ends) return fail("has no footer: cut, or never closed; hamel log recover makes an index");
  Cursor footer(View(tail).subspan(kFrame));
  const auto start = footer.get<std::uint64_t>(), offsets = footer.get<std::uint64_t>();
  const auto crc = footer.get<std::uint32_t>();
  const std::uint64_t footer_at = file_->size() - kTail;
  if (start == 0) return fail("has no summary; hamel log recover makes one");
  if (start > footer_at || footer_at - start > kMostSummary ||
      !file_->read(start, footer_at - start, summary))
    return fail("has a broken footer; hamel log recover makes a new index");
  const std::uint32_t computed = crc32(View(tail).first(kFrame + 16), crc32(summary));
  if (crc != 0 && crc != computed)
    return fail("has a summary with a wrong CRC; hamel log recover makes a new one");
  const std::uint64_t length =
      offsets == 0 ? summary.size() : std::min<std::uint64_t>(offsets - start, summary.size());
  if (!read_groups(View(summary).first(static_cast<std::size_t>(length))))
    return fail("has a broken summary");
  Cursor first(View(head).subspan(kMagic.size()));
  first.get<Op>();
  if (const auto n = first.get<std::uint64_t>(); n <= kMaxRecord && file_->read(head.size(), n, head))
    parse(head, summary_.header);
  return {};
}

bool IndexedReader::read_groups(View groups) {
  Cursor in(groups);
  bool ok = true;
  while (ok && !in.empty()) {
    const auto op = in.get<Op>();
    const View content = in.take(in.get<std::uint64_t>());
    if (!in.ok()) return false;
    if (op == Op::schema) {
      Schema s;
      ok = parse(content, s);
      summary_.schemas[s.id] = s;
    } else if (op == Op::channel) {
      Channel c;
      ok = parse(content, c);
      summary_.channels[c.id] = c;
    } else if (op == Op::chunk_index) {
      ok = parse(content, summary_.chunks.emplace_back());
    } else if (op == Op::statistics) {
      ok = parse(content, summary_.statistics.emplace());
    } else if (op == Op::attachment_index) {
      ok = parse_place(content, op, summary_.attachments.emplace_back());
    } else if (op == Op::metadata_index) {
      ok = parse_place(content, op, summary_.metadata.emplace_back());
    }
  }
  return ok;
}

Result<Attachment, Problem> IndexedReader::attachment(const Place& place) const {
  Bytes record;
  Attachment a;
  std::uint32_t crc = 0, computed = 0;
  const bool ok = place.length >= kFrame && place.length <= kMaxRecord &&
                  file_->read(place.offset, place.length, record) &&
                  parse(View(record).subspan(kFrame), a, crc, computed) && (crc == 0 || crc == computed);
  if (!ok) return Problem{file_->path(), "the attachment " + place.name + " is broken"};
  return a;
}

Result<Metadata, Problem> IndexedReader::metadata(const Place& place) const {
  Bytes record;
  Metadata m;
  const bool ok = place.length >= kFrame && place.length <= kMaxRecord &&
                  file_->read(place.offset, place.length, record) && parse(View(record).subspan(kFrame), m);
  if (!ok) return Problem{file_->path(), "the metadata " + place.name + " are broken"};
  return m;
}

void IndexedReader::seek(const Query& query) {
  query_ = query;
  wanted_.clear();
  order_.clear();
  open_.clear();
  heap_.clear();
  given_.reset();
  entered_ = 0;
  for (const auto& [id, channel] : summary_.channels)
    if (query.topics.empty() || query.topics.contains(channel.topic)) wanted_.insert(id);
  for (const ChunkIndex& c : summary_.chunks) {
    const bool touches =
        c.channels.empty() || std::any_of(c.channels.begin(), c.channels.end(),
                                          [&](const auto& e) { return wanted_.contains(e.first); });
    if (touches && c.begin <= query.end && c.end >= query.begin) order_.push_back(c);
  }
  std::stable_sort(order_.begin(), order_.end(),
                   [](const ChunkIndex& a, const ChunkIndex& b) { return a.begin < b.begin; });
}

namespace {
/// The heap's top is the earliest; of equal times the one that was written first.
constexpr auto later = [](const auto& a, const auto& b) {
  return std::tie(a.log_time, a.offset, a.at) > std::tie(b.log_time, b.offset, b.at);
};
}  // namespace

std::optional<Item> IndexedReader::next() {
  if (given_) {
    auto& [bytes, waiting] = open_[*given_];
    if (--waiting == 0) open_.erase(*given_);
    given_.reset();
  }
  // A chunk must be open before anything is given that is not earlier than its first message.
  while (entered_ < order_.size() && (heap_.empty() || order_[entered_].begin <= heap_.front().log_time))
    if (auto damage = enter(order_[entered_++])) return *damage;
  if (heap_.empty()) return {};
  std::pop_heap(heap_.begin(), heap_.end(), later);
  const Waiting w = heap_.back();
  heap_.pop_back();
  given_ = w.chunk;
  return w.message;
}

std::optional<Damage> IndexedReader::enter(const ChunkIndex& index) {
  Bytes record, bytes;
  Chunk c;
  const bool there = index.length >= kFrame && index.length <= kMaxRecord &&
                     file_->read(index.offset, index.length, record) &&
                     record[0] == static_cast<std::byte>(Op::chunk) && parse(View(record).subspan(kFrame), c);
  if (!there) return Damage{index.offset, "no chunk is where the index says"};
  std::string what = decompress(c.compression, c.records, c.uncompressed_size, bytes);
  if (what.empty() && c.crc != 0 && crc32(bytes) != c.crc) what = "CRC is wrong";
  if (!what.empty()) return Damage{index.offset, "a chunk cannot be used: " + what};
  const std::size_t chunk = entered_ - 1;
  open_[chunk] = {std::move(bytes), 0};
  queue(chunk);
  return {};
}

/// The messages of a chunk that the query asks for, told by the chunk itself: its index can only agree.
void IndexedReader::queue(std::size_t chunk) {
  auto& [bytes, waiting] = open_[chunk];
  Cursor in(bytes);
  while (in.ok() && !in.empty()) {
    const std::uint64_t at = bytes.size() - in.rest().size();
    const auto op = in.get<Op>();
    const View content = in.take(in.get<std::uint64_t>());
    Message m;
    if (!in.ok() || op != Op::message || !parse(content, m)) continue;
    if (!wanted_.contains(m.channel) || m.log_time < query_.begin || m.log_time > query_.end) continue;
    heap_.push_back({m.log_time, order_[chunk].offset, at, chunk, m});
    std::push_heap(heap_.begin(), heap_.end(), later);
    ++waiting;
  }
  if (waiting == 0) open_.erase(chunk);
}

}  // namespace hamel::record
