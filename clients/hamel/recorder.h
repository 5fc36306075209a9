#pragma once
/// Everything on the bus into one MCAP file, as the bytes it travelled as.

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/hamel/commands.h"
#include "common/record/writer.h"
#include "common/runtime/loop.h"
#include "common/scene/scene.h"

namespace hamel::client {

struct RecorderOptions {
  std::string path;
  record::Compression compression = record::Compression::lz4;
  const scene::Scene* scene = nullptr;  ///< kept in the file where it is known
  std::string pace;                     ///< "lockstep", "realtime"; empty: unknown
};

/// One channel a topic of the table.  A message's log time is its sample time on the run's clock; goal, mode,
/// status, robot and summary have none and get that of the run's clock when they came.  Messages of one topic
/// keep the order in which they were published; of different topics that came together, the earlier sample
/// time is first, and of equal ones the cause before its effect (obstacles, state, command, report).  Memory:
/// what the bus holds, and one chunk.
class Recorder final : public runtime::Service {
 public:
  static Result<std::unique_ptr<Recorder>, Problem> open(bus::Node& node, const RecorderOptions& options);
  bool poll(runtime::Clock::time_point now) override;
  runtime::Clock::time_point due() const override {
    return runtime::Clock::now() + std::chrono::milliseconds(50);
  }
  bool finished() const override { return false; }
  /// Takes what still waits and closes the file.
  void close() override;

  /// Topics that have a writer now.
  int topics_alive() const;
  std::uint64_t messages() const { return file_->messages(); }
  std::uint64_t lost() const;
  /// Why the file stopped growing; the run goes on without it.
  const std::optional<Problem>& problem() const { return file_->problem(); }
  /// "418 kB, 12000 messages in 7 topics, none lost"
  std::string report() const;

 private:
  struct Sample {
    std::uint64_t time = 0;
    bool timed = false;
    bus::Payload payload;
  };
  struct Line {
    const Topic* topic = nullptr;
    std::unique_ptr<bus::Reader> reader;
    std::uint16_t channel = 0;
    std::uint64_t recorded = 0;
    std::vector<Sample> waiting;
    std::size_t next = 0;
  };
  Recorder(bus::Node& node, const RecorderOptions& options, std::unique_ptr<record::Writer> file);
  void begin(const RecorderOptions& options);
  bool take();
  Line* earliest();
  void put(Line& line, runtime::Clock::time_point now);
  void put_counters();

  std::unique_ptr<record::Writer> file_;
  std::array<Line, kTopics.size()> lines_;
  std::uint64_t now_ns_ = 0;  ///< the run's clock as far as it was heard
  bool told_ = false, closed_ = false;
};

/// The recorder that --record asks for; null where it does not.
Result<std::unique_ptr<Recorder>, Problem> open_recorder(bus::Node& node, const RunArgs& args,
                                                         const scene::Scene& scene, scene::Pace pace);

}  // namespace hamel::client
