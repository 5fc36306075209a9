#pragma once
/// What `hamel play` puts on the bus, one message after the other: recorded bytes, or sets made from a CSV.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "idl/topics.h"

namespace hamel::client {

struct PlayArgs;

/// A message and its time [ns of the recording].  `payload` is valid until the next one is asked for.
struct Played {
  const Topic* topic = nullptr;
  std::uint64_t time = 0;
  std::span<const std::byte> payload;
};

class PlaySource {
 public:
  virtual ~PlaySource() = default;
  /// The topics that messages will come of.
  virtual std::vector<const Topic*> topics() const = 0;
  /// Begins anew.
  virtual void rewind() = 0;
  /// In the order of their times; none at the end.
  virtual std::optional<Played> next() = 0;
};

/// Of a recording: the chosen topics' bytes as they were recorded, between --start and --until.  Of a CSV:
/// one obstacle set for each of its times, with velocities estimated as perception does.
Checked<std::unique_ptr<PlaySource>> open_play_source(const PlayArgs& args);

}  // namespace hamel::client
