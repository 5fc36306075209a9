/// mcap_samples FILE COMPRESSION: one message of every type, with a different number in every field, for
/// foreign readers.

#include <cstdio>

#include "common/record/writer.h"
#include "common/wire/codec.h"
#include "tests/integration/golden.h"

using namespace hamel;

namespace {

template <class T>
void add(record::Writer& out) {
  T message;
  test::golden(message);
  bus::Payload payload;
  if (!wire::encode(message, payload)) std::abort();
  const Topic& topic = wire::topic_of<T>();
  const auto schema =
      out.add(record::Schema{0, std::string(topic.type), "omgidl", std::string(wire::idl_text())});
  const auto channel = out.add(record::Channel{0, schema, std::string(topic.name), "cdr", {}});
  out.write(record::Message{channel, 0, 4'500'000'000, 4'500'000'000, payload}, {});
}

}  // namespace

int main(int argc, char** argv) {
  const auto compression = record::compression_from(argc > 2 ? argv[2] : "lz4");
  if (argc < 2 || !compression) return 2;
  const auto file = record::Writer::create(argv[1], {.compression = compression.value()});
  if (!file) return 2;
  record::Writer& out = *file.value();
  out.write(record::Attachment{0, 0, "robot.urdf", "application/xml", "<robot/>"});
  out.write(record::Metadata{"hamel", {{"version", "test"}}});
  add<wire::ArmState>(out), add<wire::TorqueCommand>(out), add<wire::Goal>(out), add<wire::ObstacleSet>(out);
  add<wire::PlannerReport>(out), add<wire::ModeCommand>(out), add<wire::ServiceStatus>(out);
  add<wire::RobotDescription>(out), add<wire::SimulationClock>(out), add<wire::RunSummary>(out);
  return out.close() ? 0 : 2;
}
