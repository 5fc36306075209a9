#pragma once
/// One end of a topic, as our bus makes it or a plain program of a vendor: for laws that hold between any
/// two.

#include <cstdint>
#include <memory>
#include <optional>

#include "idl/topics.h"

namespace hamel::test {

/// What a reader saw of a key.
struct Sight {
  enum What : std::uint8_t {
    data,
    disposed,
    left,  ///< its last writer gave it up
    gone,  ///< one of the two, of some key: our reader counts them alike
  } what = data;
  std::uint32_t key = 0, number = 0;
};

class WriterEnd {
 public:
  virtual ~WriterEnd() = default;  ///< leaves in good order
  virtual void write(std::uint32_t key, std::uint32_t number) = 0;
  virtual void dispose(std::uint32_t key) = 0;
  virtual void unregister(std::uint32_t) {}  ///< ours cannot
};

class ReaderEnd {
 public:
  virtual ~ReaderEnd() = default;
  virtual std::optional<Sight> take() = 0;
  virtual int writers() = 0;  ///< known now
  virtual int late() = 0;     ///< deadlines that were missed
  virtual int silent() = 0;   ///< writers that no longer say that they live
};

/// Ends of the topics goal and command in the vendors' own API and their generators' types, configured by the
/// profiles of deploy/qos.  Writers promise what idl/topics.h says, readers ask for it; keys that a writer
/// unregisters are not disposed.
std::unique_ptr<WriterEnd> fast_writer(const Topic& topic, unsigned domain);
std::unique_ptr<ReaderEnd> fast_reader(const Topic& topic, unsigned domain);
std::unique_ptr<WriterEnd> cyclone_writer(const Topic& topic, unsigned domain);
std::unique_ptr<ReaderEnd> cyclone_reader(const Topic& topic, unsigned domain);

/// The life of a writer, and what a reader that asks allows beyond it (of rounding on the wire).
inline constexpr int kLease_ms = 1000, kRounding_ms = 1;

}  // namespace hamel::test
