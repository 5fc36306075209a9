#pragma once
/// doctor, topic and bench: their options, and what to do when they were asked for.

#include <optional>

#include "clients/hamel/bench_bus.h"
#include "clients/hamel/doctor.h"
#include "clients/hamel/topic.h"

namespace hamel::client {

class NetworkVerbs {
 public:
  explicit NetworkVerbs(CLI::App& app);
  /// The exit code, where one of them was asked for.
  std::optional<int> run() const;

 private:
  void add_bench(CLI::App& app);
  CLI::App* add_topic(const char* name, const char* help, bool named);
  DoctorArgs doctor_args_;
  TopicArgs topic_args_;
  BenchBusArgs bench_args_;
  CLI::App *doctor_, *topic_, *list_, *echo_, *hz_, *latency_, *bench_bus_;
};

}  // namespace hamel::client
