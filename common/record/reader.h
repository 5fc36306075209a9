#pragma once
/// Reads MCAP files, whole, cut or damaged: from beginning to end, or by their index.

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <variant>

#include "common/base/result.h"
#include "common/record/format.h"

namespace hamel::record {

/// Something in a file that is not as it should be; reading goes on behind it.
struct Damage {
  std::uint64_t offset = 0;
  std::string what;
};

using Item = std::variant<Schema, Channel, Message, Attachment, Metadata, Damage>;

/// A file by offset.  Total: a short read is a false, never a signal.
class File {
 public:
  static Result<std::unique_ptr<File>, Problem> open(const std::string& path);
  ~File();
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  /// Exactly n bytes at `offset` into `out`.
  bool read(std::uint64_t offset, std::uint64_t n, Bytes& out) const;
  std::uint64_t size() const { return size_; }
  const std::string& path() const { return path_; }

 private:
  File(std::string path, int fd, std::uint64_t size) : path_(std::move(path)), fd_(fd), size_(size) {}
  std::string path_;
  int fd_;
  std::uint64_t size_;
};

/// Everything of a file in the order it was written.  A chunk whose CRC or framing is wrong is reported and
/// passed over; where a length is wrong the next chunk that fits is looked for.  Memory: one chunk.
class StreamReader {
 public:
  /// Fails where the file cannot be opened or does not begin as an MCAP file.
  static Result<StreamReader, Problem> open(const std::string& path);
  /// The next item; none at the end.  A Message's data is valid until the next call.
  std::optional<Item> next();
  /// True once the footer was reached without anything missing.
  bool complete() const { return complete_; }
  const std::string& path() const { return file_->path(); }

 private:
  explicit StreamReader(std::unique_ptr<File> file) : file_(std::move(file)) {}
  std::optional<Item> next_in_chunk();
  std::optional<Item> next_in_file();
  std::optional<Item> use(Op op, std::uint64_t at, View content);
  std::optional<Item> enter_chunk(std::uint64_t at, View content);
  std::optional<Item> end_data(std::uint64_t at, View content);
  std::optional<Item> end_file(std::uint64_t at, View content);
  Item lost(std::uint64_t at, std::string what);
  bool find_chunk(std::uint64_t from);
  std::optional<Item> admit(std::uint64_t at, const Message& m);
  std::optional<Item> admit(Channel c);

  std::unique_ptr<File> file_;
  std::uint64_t at_ = 0;    ///< where the next record of the file begins
  std::uint64_t sure_ = 0;  ///< end of the last chunk: its lengths agreed
  Bytes record_, chunk_;
  std::size_t chunk_at_ = 0;        ///< how far the chunk was read
  std::uint64_t chunk_offset_ = 0;  ///< where it stands in the file; 0: none yet
  std::deque<Item> waiting_;
  std::set<std::uint16_t> channels_, strangers_;
  std::uint32_t crc_ = 0;  ///< of the file before at_, while whole_
  bool whole_ = true, complete_ = false, ended_ = false, described_ = false;
};

/// What the summary at a file's end says.
struct Summary {
  Header header;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<ChunkIndex> chunks;
  std::vector<Place> attachments, metadata;
  std::optional<Statistics> statistics;
};

/// Which messages an indexed reader gives.
struct Query {
  std::set<std::string> topics;                      ///< empty: all
  std::uint64_t begin = 0, end = ~std::uint64_t{0};  ///< log time, both inclusive
};

/// Messages in the order of their log times, those of equal time in the order they were written; only the
/// chunks that the query touches are read.
class IndexedReader {
 public:
  /// Fails, with one sentence, where the file has no whole summary: `hamel log recover` makes one.
  static Result<IndexedReader, Problem> open(const std::string& path);
  const Summary& summary() const { return summary_; }
  Result<Attachment, Problem> attachment(const Place& place) const;
  Result<Metadata, Problem> metadata(const Place& place) const;

  /// Begins anew.
  void seek(const Query& query);
  /// A Message or a Damage; none at the end.  A Message's data is valid until the next call.
  std::optional<Item> next();

 private:
  struct Waiting {
    std::uint64_t log_time = 0, offset = 0, at = 0;  ///< of its chunk in the file, of itself in the chunk
    std::size_t chunk = 0;
    Message message;
  };
  explicit IndexedReader(std::unique_ptr<File> file) : file_(std::move(file)) {}
  std::optional<Problem> load();
  bool read_groups(View groups);
  std::optional<Damage> enter(const ChunkIndex& index);
  void queue(std::size_t chunk);

  std::unique_ptr<File> file_;
  Summary summary_;
  Query query_;
  std::set<std::uint16_t> wanted_;
  std::vector<ChunkIndex> order_;  ///< chunks of the query by their first log time
  std::size_t entered_ = 0;
  std::map<std::size_t, std::pair<Bytes, std::size_t>>
      open_;  ///< chunks in use and messages of them that wait
  std::vector<Waiting> heap_;
  std::optional<std::size_t> given_;  ///< the chunk of the message given last
};

/// What recover() found.
struct Recovery {
  std::uint64_t messages = 0, attachments = 0, metadata = 0;
  std::vector<Damage> damages;
  bool complete = false;  ///< the input had its footer
};

/// Name of the metadata that recover() adds where messages are missing between those it found.
inline constexpr const char* kRecovered = "recovered";

/// Copies everything that is whole in `in` to a new file with a new index; fails where `in` is no MCAP file
/// or `out` cannot be written.
Result<Recovery, Problem> recover(const std::string& in, const std::string& out, Compression compression);

}  // namespace hamel::record
