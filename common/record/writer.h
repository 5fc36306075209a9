#pragma once
/// Writes an MCAP file that is worth reading at any moment of its making.

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/record/format.h"

namespace hamel::record {

struct WriterOptions {
  Compression compression = Compression::lz4;
  std::size_t chunk_bytes = 256 * 1024;        ///< uncompressed; a larger message makes a larger chunk
  std::chrono::milliseconds flush_every{500};  ///< a chunk is written when it is so old
  std::string library = "hamel";
};

/// One file, one thread.  Everything goes out in whole chunks, each with its message index, so that a process
/// that is killed loses at most what is younger than `flush_every`.  Memory: one chunk, however long the file
/// gets; the index of the chunks is gathered from the file when it is closed.  When the disk refuses, the
/// file is cut back to its last whole record, the reason is kept in problem(), and everything later is
/// counted as refused; close() still tries to write the summary.  What cannot be read back (a pipe) gets no
/// index.
class Writer {
 public:
  using Time = std::chrono::steady_clock::time_point;

  static Result<std::unique_ptr<Writer>, Problem> create(const std::string& path,
                                                         const WriterOptions& options);
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// Numbers are given in order from 1; a schema's `id` is ignored.
  std::uint16_t add(Schema schema);
  /// Its schema must have been added (0: none).
  std::uint16_t add(Channel channel);
  /// The channel must have been added.  `now` decides when the chunk goes out.  False when refused.
  bool write(const Message& message, Time now);
  bool write(const Attachment& attachment);
  bool write(const Metadata& metadata);
  /// Writes the chunk out if it is old enough; call it when nothing arrives.
  bool tick(Time now);
  /// Writes the open chunk out.
  bool flush();
  /// Writes summary and footer.  False when anything was refused since the beginning.
  bool close();

  const std::optional<Problem>& problem() const { return problem_; }
  std::uint64_t messages() const { return statistics_.messages; }
  std::uint64_t refused() const { return refused_; }
  std::uint64_t bytes() const { return offset_; }

 private:
  Writer(std::string path, int fd, const WriterOptions& options);
  bool put(View bytes);
  void index(const Message& message);
  void enter(const Message& message, Time now);
  bool put_chunk();
  void count_chunk();
  void put_summary();
  template <class Fill>
  void put_group(Op op, Bytes& offsets, Fill&& fill);
  void put_indexes(std::uint64_t end);
  void cut(std::uint64_t end);

  const std::string path_;
  const WriterOptions options_;
  int fd_;
  bool closed_ = false;
  std::uint64_t offset_ = 0;  ///< where the next record goes; everything before is whole
  std::uint32_t crc_ = 0;     ///< of everything before; of the summary, once that has begun
  std::optional<Problem> problem_;

  Bytes chunk_, packed_, record_;
  std::uint64_t begin_ = 0, end_ = 0, in_chunk_ = 0;
  std::optional<Time> opened_;  ///< when the chunk got its first message
  using Entry = std::pair<std::uint64_t, std::uint64_t>;
  std::map<std::uint16_t, std::vector<Entry>> entries_;  ///< log time and place in the chunk, by channel

  std::vector<Schema> schemas_;
  std::vector<Channel> channels_;
  std::size_t schemas_out_ = 0, channels_out_ = 0;  ///< those that a chunk holds already
  std::vector<Place> attachments_, metadata_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  Statistics statistics_;
  std::uint64_t refused_ = 0;
};

}  // namespace hamel::record
