#pragma once
/// A typed topic: bytes of the bus on one side, checked plain messages on the other.

#include <memory>

#include "common/bus/bus.h"
#include "common/wire/codec.h"

namespace hamel::wire {

template <class T>
class Publisher {
 public:
  explicit Publisher(bus::Node& node) : writer_(node.writer(topic_of<T>())) {}
  /// False when the message could not be encoded or the bus refused it.
  bool publish(const T& m) { return encode(m, buffer_) && writer_->write(buffer_); }
  /// Says that the arm (the key) of `m` is no longer ours to speak of.
  bool dispose(const T& m) { return encode(m, buffer_) && writer_->dispose(buffer_); }
  int matched() const { return writer_->matched(); }
  bus::WriterId id() const { return writer_->id(); }

 private:
  std::unique_ptr<bus::Writer> writer_;
  bus::Payload buffer_;
};

template <class T>
class Subscription {
 public:
  explicit Subscription(bus::Node& node, bus::Ask ask = bus::Ask::data)
      : node_(node), reader_(node.reader(topic_of<T>(), 0, ask)) {}

  /// The oldest waiting message that decodes; those that do not are counted and dropped.  False when none
  /// waits, and after kRound messages in a row, good or bad, once: a flood must not keep the caller from what
  /// is due.  The node's next wait() then returns at once.
  bool take(T& m) {
    while (in_a_row_ < kRound && reader_->take(buffer_)) {
      ++in_a_row_;
      const auto r = decode<T>(buffer_, m);
      if (r) return true;
      ++undecodable_;
      last_error_ = r.error();
    }
    if (in_a_row_ == kRound) node_.wake();
    in_a_row_ = 0;
    return false;
  }
  static constexpr int kRound = 64;

  /// The writer of what take() gave last.
  bus::WriterId from() const { return reader_->from(); }
  int matched() const { return reader_->matched(); }
  bus::Counters counters() const { return reader_->counters(); }
  std::uint64_t undecodable() const { return undecodable_; }
  DecodeError last_error() const { return last_error_; }

 private:
  bus::Node& node_;
  std::unique_ptr<bus::Reader> reader_;
  bus::Payload buffer_;
  int in_a_row_ = 0;
  std::uint64_t undecodable_ = 0;
  DecodeError last_error_;
};

}  // namespace hamel::wire
